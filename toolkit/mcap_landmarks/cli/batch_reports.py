"""What became of the logs of a batch: outcomes, figures, errors, as a document and as a table."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypedDict

from mcap_landmarks.cli.console import DONE, PARTIAL, say, table, warn
from mcap_landmarks.locations import Location

if TYPE_CHECKING:
    from mcap_landmarks.fleet.tasks import Ended

BatchOutcome = Literal["done", "partial", "failed", "skipped"]
OUTCOMES: tuple[BatchOutcome, ...] = ("done", "partial", "failed", "skipped")
_OUTCOME_OF: dict[int, BatchOutcome] = {DONE: "done", PARTIAL: "partial"}
Stamp = tuple[int, int] | None
"""A file's inode and time of change; None where there is none, or nobody can tell."""


class Report(TypedDict):
    """What became of one log; `result` is the verb's own document, or that of its error; None if it gave none.

    `skipped`: its results were there, with the keys that they would have now, and nothing was written.
    """

    log: str
    output: str | None
    outcome: BatchOutcome
    exit_code: int
    seconds: float
    peak_bytes: int | None
    attempts: int
    errors: list[str]
    notes: list[str]
    result: object


def stamp(place: Location) -> Stamp:
    """What is at a place on this machine, to see later whether it was written."""
    try:
        status = place.stat() if isinstance(place, Path) else None
    except OSError:
        return None
    return status and (status.st_ino, status.st_mtime_ns)


def report_of(verb: str, ended: "Ended", before: Stamp) -> Report:
    """What became of a task whose output was as `before`; the document of `evaluate` is kept."""
    outcome = _OUTCOME_OF.get(ended.exit_code, "failed")
    failed = outcome == "failed"
    if verb == "evaluate" and not failed:
        _keep(ended)
    result = _document(ended)
    if outcome == "done" and _is_reused(result, ended.task.output, before):
        outcome = "skipped"
    lines = ended.stderr.splitlines()
    errors = [_naming(line, ended) for line in lines if line.startswith("error: ")]
    return {
        "log": str(ended.task.log),
        "output": None if failed else str(ended.task.output),
        "outcome": outcome,
        "exit_code": ended.exit_code,
        "seconds": round(ended.seconds, 3),
        "peak_bytes": ended.peak_bytes,
        "attempts": ended.attempts,
        "errors": errors or ([_last_words(verb, ended)] if failed else []),
        "notes": [line for line in lines if line.startswith(("note: ", "warning: "))],
        "result": result,
    }


def _naming(line: str, ended: "Ended") -> str:
    """An error that names its log: not every one is about the log."""
    log = str(ended.task.log)
    return line if log in line else f"error: {log}: {line.removeprefix('error: ')}"


def _is_reused(result: object, output: Location, before: Stamp) -> bool:
    stages = result.get("stages") if isinstance(result, Mapping) else None
    if not isinstance(stages, Mapping) or not stages or any(state != "reused" for state in stages.values()):
        return False
    return not isinstance(output, Path) or (before is not None and stamp(output) == before)


def _document(ended: "Ended") -> object:
    """What a verb printed, None if its process was killed before that was whole."""
    try:
        return json.loads(ended.stdout)
    except ValueError:
        return None


def _last_words(verb: str, ended: "Ended") -> str:
    """An error in place of the one that a verb did not give."""
    last = f": {ended.stderr.splitlines()[-1]}" if ended.stderr else ""
    return f"error: {ended.task.log}: {verb} ended with {ended.exit_code}{last}"


def _keep(ended: "Ended") -> None:
    from mcap_landmarks.atomic import atomic_file

    with atomic_file(ended.task.output) as stream:
        stream.write(ended.stdout.encode())


def counts_of(reports: Sequence[Report]) -> dict[str, int]:
    """How many logs have each outcome."""
    outcomes = [report["outcome"] for report in reports]
    return {name: outcomes.count(name) for name in OUTCOMES}


def say_errors(reports: Sequence[Report]) -> None:
    """The errors of all logs that failed, on stderr."""
    for report in reports:
        for line in report["errors"]:
            warn(line)


def print_reports(verb: str, reports: Sequence[Report], counts: Mapping[str, int]) -> None:
    """A row per log, and the counts, on stdout."""
    head = list(_FIGURES[verb]) if verb in _FIGURES else []
    rows = []
    for report in reports:
        result = report["result"]
        figures = [_shown(result, path) for path in _FIGURES.get(verb, {}).values()] if result else ["-"] * len(head)
        seconds = f"{report['seconds']:.1f} s"
        rows.append([report["log"], report["outcome"], seconds, *figures, report["output"] or "-"])
    table(["log", "outcome", "time", *head, "output"], rows)
    say(", ".join(f"{count} {name}" for name, count in counts.items() if count))


_FIGURES: dict[str, dict[str, tuple[str, ...]]] = {
    "convert": {"messages": ("read",), "lost": ("lost",)},
    "map": {"bundles": ("bundles",)},
    "detect": {"images": ("images",), "detections": ("detections",)},
    "localize": {"bundles": ("bundles",), "localized": ("statuses", "localized")},
    "evaluate": {
        "scored": ("scored",),
        "false": ("false", "count"),
        "RMSE": ("position", "rmse_m"),
        "median": ("position", "median_m"),
    },
}
"""The columns of a verb's table, and where its document has them."""


def _shown(document: object, path: Sequence[str]) -> str:
    value = document
    for key in path:
        value = value.get(key) if isinstance(value, Mapping) else None
    if value is None:
        return "-"
    return f"{value:.4f} m" if isinstance(value, float) else str(value)
