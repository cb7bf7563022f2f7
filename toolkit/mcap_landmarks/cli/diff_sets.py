"""How `diff` compares two sets of logs, folders or catalogues, and tells what it found."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mcap_landmarks.cli.console import DONE, USAGE, progress, say, say_json, table, warn
from mcap_landmarks.cli.diff_options import SetOptions
from mcap_landmarks.cli.diff_text import DIFFERENT, number, short, value_text
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, same_place
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.diff.set_document import LogEntry, SetDocument, VerdictEntry

_WORST = 10
"""So many of the worst logs are shown; the JSON has all."""


def _bless(candidate: Location, folder: Location, reference: Location | None, *, json: bool) -> int:
    """Keep the figures of all logs of a folder; the exit code."""
    from mcap_landmarks.diff.blessed import bless as keep
    from mcap_landmarks.diff.set_logs import blessed_logs, set_size

    if same_place(folder, candidate):
        raise UsageError(f"--baseline {folder}: holds the results themselves; name another folder for what is blessed")
    with progress("read", set_size(candidate)) as advance:
        logs = blessed_logs(candidate, reference, advance)
    path = keep(folder, logs)
    if json:
        say_json("diff_bless", {"output": str(path), "logs": [log.name for log in logs]})
    else:
        say(f"{path}: {counted(len(logs), 'log')} blessed")
    return DONE


def diff_folders(
    baseline: Location,
    candidate: Location,
    given: SetOptions,
    fail_on: "Sequence[str]",
    reference: Location | None,
    *,
    json: bool,
) -> int:
    """Compare two folders, tell what was found, and write the files that are asked for; the exit code.

    Raises:
        ToolkitError: they cannot be compared.
    """
    from mcap_landmarks.diff.conditions import parse
    from mcap_landmarks.diff.criteria import read_criteria
    from mcap_landmarks.diff.set_logs import check_sets, set_size
    from mcap_landmarks.diff.sets import diff_sets
    from mcap_landmarks.runs.replacing import new_files

    if given.bless:
        if given.blessed is None:
            raise UsageError("--bless: where to? name CANDIDATE alone, and a folder with --baseline DIR")
        return _bless(candidate, baseline, reference, json=json)
    conditions = [parse(text) for text in fail_on]
    check_sets(baseline, candidate)
    criteria = None if given.criteria is None else read_criteria(given.criteria)
    outputs, inputs = (given.junit, given.markdown), (baseline, candidate, given.criteria, reference)
    with new_files(outputs, inputs, overwrite=given.overwrite):
        with progress("compare", set_size(baseline) + set_size(candidate)) as advance:
            document = diff_sets(baseline, candidate, criteria, conditions, reference=reference, progress=advance)
        _write(given, document)
    if json:
        say_json("diff_sets", document)
    else:
        _print(document)
    _warn((baseline, candidate), document)
    if document["broken"]:
        return USAGE
    return DIFFERENT if document["fails"] else DONE


def _warn(folders: "Sequence[Location]", document: "SetDocument") -> None:
    from mcap_landmarks.diff.set_logs import maps_in

    for folder in folders:
        maps = maps_in(folder)
        if maps:
            warn(f"note: {folder}: maps are compared one by one, and {short(', '.join(maps))} not at all here")
    for broken in document["broken"]:
        warn(f"error: {broken['error']}")


def _write(given: SetOptions, document: "SetDocument") -> None:
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.diff.junit import junit
    from mcap_landmarks.diff.markdown import markdown

    if given.junit is not None:
        with atomic_file(given.junit) as stream:
            stream.write(junit(document))
    if given.markdown is not None:
        with atomic_file(given.markdown) as stream:
            stream.write(markdown(document).encode())


def _print(document: "SetDocument") -> None:
    pairs, share = counted(document["pairs"], "pair"), f"{100 * document['confidence']:g} %"
    partial = ", of a part of the logs" if document["partial"] else ""
    say(f"{document['verdict']}: over {pairs} of logs, at {share} confidence{partial}")
    _print_left_out(document)
    if document["manifest"]:
        say()
        rows = [
            [short(row["key"]), value_text(row["baseline"]), value_text(row["candidate"]), str(row["logs"])]
            for row in document["manifest"]
        ]
        table(["meant to differ", "baseline", "candidate", "logs"], rows)
    _print_verdicts(document["metrics"])
    _print_logs(document["logs"])
    _print_failures(document)


def _print_left_out(document: "SetDocument") -> None:
    """The logs that are no pair of their own, by name."""
    from mcap_landmarks.diff.set_text import left_out_of

    rows = left_out_of(document)
    if rows:
        say()
        table([f"no pair of their own: {len(rows)}", "why"], rows)
    by_name = [log["log"] for log in document["logs"] if log["paired_by"] == "name"]
    if by_name:
        say()
        say(f"of other recordings, and paired by name alone: {short(', '.join(by_name))}")


def _print_verdicts(metrics: "dict[str, VerdictEntry]") -> None:
    from mcap_landmarks.diff.set_text import FIGURE_HEAD, figure_cells, telling

    shown, others = telling(metrics)
    head = ["verdict", *FIGURE_HEAD]
    for title, gates in (("metrics that gate", True), ("other metrics", False)):
        rows = [
            [name, entry["verdict"], *figure_cells(entry)]
            for name, entry in ((name, metrics[name]) for name in shown)
            if entry["gates"] == gates
        ]
        if rows:
            say()
            table([title, *head], rows)
        for note in dict.fromkeys(metrics[name]["note"] for name, *_ in rows):
            if note:
                say(f"  {note}")
    if others:
        say(f"  the same: {', '.join(others)}")
    for name, entry in metrics.items():
        if entry["lost"]:
            say(f"  {name}: of {counted(entry['lost'], 'log')} the baseline has it and the candidate does not")


def _print_logs(logs: "Sequence[LogEntry]") -> None:
    from mcap_landmarks.diff.set_text import worst_of

    rows = [[log["log"], *worst] for log in logs if (worst := worst_of(log)) is not None]
    if rows:
        say()
        table(["worst logs", "metric", "baseline", "candidate", "change"], rows[:_WORST])
    if len(rows) > _WORST:
        say(f"  and {len(rows) - _WORST} more that got worse; --json has all")


def _print_failures(document: "SetDocument") -> None:
    from mcap_landmarks.diff.set_text import failures_of

    lines = [f"fails: {name}: {why}" for name, why in failures_of(document)]
    kept = (one for one in document["conditions"] if not one["holds"])
    lines += [f"holds not: {one['condition']} (it is {number(one['value'])})" for one in kept]
    if lines:
        say()
    for line in lines:
        say(line)
