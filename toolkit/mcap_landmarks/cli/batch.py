"""Run a verb over many logs with local processes."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, progress, say, say_json, table, warn
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from pathlib import Path

    from mcap_landmarks.runs.batch import ProcessEnd, ProcessTask

context_settings = {"allow_extra_args": True, "ignore_unknown_options": True}
_SUFFIX = {
    **dict.fromkeys(("convert", "detect", "cluster", "fuse", "localize", "run"), ".mcap"),
    "map": ".db",
    "evaluate": ".json",
}
_ONE_FILE = {"map": ("--map",), "evaluate": ("--tum", "--thesis")}
_DETECTS = ("detect", "map", "localize", "run")
_CALL = (sys.executable, "-m", "mcap_landmarks.batched")


class _Report(TypedDict):
    """What became of one log; `result` is the verb's own document, or that of its error; None if it gave none."""

    log: str
    output: str | None
    outcome: str
    exit_code: int
    errors: list[str]
    notes: list[str]
    result: object


def command(
    verb: Annotated[str, typer.Argument(metavar="VERB", help=", ".join(_SUFFIX) + ".")],
    words: Annotated[
        list[str],
        typer.Argument(metavar="GLOB... [OPTIONS OF VERB]", help="Logs, by name or quoted pattern: 'logs/**/*.mcap'."),
    ],
    output: Annotated[
        Location, typer.Option("-o", "--output", parser=location, help="Folder for the results, named as their logs.")
    ],
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Logs at a time; as many as cores by default.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Run VERB over every log, each in a process of its own; a log that fails does not stop the others.

    Options of VERB pass through: batch localize 'logs/*.mcap' --map m.db -o out --set localize.max_sigma_m=0.3
    """
    from mcap_landmarks.runs.batch import run_tasks
    from mcap_landmarks.runs.outputs import no_empty_folder

    with no_empty_folder(output):
        tasks = _tasks(verb, words, output)
        count = min(workers or len(os.sched_getaffinity(0)), len(tasks))
        with progress(verb, len(tasks), "logs") as advance:
            reports = [_report(verb, ended) for ended in run_tasks(tasks, count, advance)]
    for report in reports:
        for line in (*report["notes"], *report["errors"]):
            warn(line)
    outcomes = [report["outcome"] for report in reports]
    counts = {name: outcomes.count(name) for name in ("done", "partial", "failed")}
    if json:
        say_json("batch", {"verb": verb, **counts, "logs": reports})
    else:
        _print(verb, reports, counts)
    if counts["failed"] == len(tasks):
        raise typer.Exit(UNUSABLE)
    if counts["done"] < len(tasks):
        raise typer.Exit(PARTIAL)


def _tasks(verb: str, words: Sequence[str], output: Location) -> "list[ProcessTask]":
    """What to run; the options are checked by the verb's own parser before anything runs.

    Raises:
        UsageError: the verb, an option or an output makes no sense.
    """
    from mcap_landmarks.runs.batch import ProcessTask, find_logs, outputs_in
    from mcap_landmarks.runs.outputs import make_folder

    own = _command_of(verb)
    patterns, passed = _split(verb, own, words)
    if not patterns:
        raise UsageError(f"batch {verb}: name the logs, or a quoted pattern such as 'logs/*.mcap'")
    if verb in _DETECTS:
        passed = ["--set", "detect.threads=1", *passed]
    logs = find_logs(patterns)
    tasks = []
    for log, target in outputs_in(make_folder(output), logs, _SUFFIX[verb]).items():
        where = {"map": ["--map", str(target)], "evaluate": []}.get(verb, ["-o", str(target)])
        tasks.append(ProcessTask(log, target, (*_CALL, verb, str(log), *where, "--json", *passed)))
    own.make_context(verb, list(tasks[0].command[len(_CALL) + 1 :]))
    if verb == "evaluate":
        _check_documents(tasks, logs, overwrite="--overwrite" in passed)
    return tasks


def _check_documents(tasks: "Sequence[ProcessTask]", logs: "Sequence[Path]", *, overwrite: bool) -> None:
    """Refuse to replace what is there by the documents that are kept here, before anything runs."""
    from mcap_landmarks.runs.replacing import new_files

    with new_files([task.output for task in tasks], logs, overwrite=overwrite):
        pass


def _command_of(verb: str) -> TyperCommand:
    from mcap_landmarks.cli.main import build

    if verb in _SUFFIX:
        application = typer.main.get_command(build(verb))
        own = application.commands.get(verb) if isinstance(application, TyperGroup) else None
        if isinstance(own, TyperCommand):
            return own
    raise UsageError(f"batch {verb}: there is no such verb for many logs; choose one of {', '.join(_SUFFIX)}")


def _split(verb: str, own: TyperCommand, words: Sequence[str]) -> tuple[list[str], list[str]]:
    """The patterns, and the verb's options with their values."""
    options = [option for option in own.params if isinstance(option, TyperOption)]
    takes = {name: not option.is_flag for option in options for name in option.opts}
    patterns, passed = [], []
    rest = iter(words)
    for word in rest:
        if not word.startswith("-"):
            patterns.append(word)
            continue
        name, equals, _ = word.partition("=")
        if name not in takes:
            raise UsageError(f"{name} is no option of {verb}; see mcap-landmarks {verb} --help")
        if name in _ONE_FILE.get(verb, ()):
            raise UsageError(f"{name} names one file, and batch {verb} has many logs; run {verb} without batch for it")
        passed.append(word)
        if takes[name] and not equals:
            passed.extend(islice(rest, 1))
    return patterns, passed


def _report(verb: str, ended: "ProcessEnd") -> _Report:
    outcome = {DONE: "done", PARTIAL: "partial"}.get(ended.exit_code, "failed")
    failed = outcome == "failed"
    if verb == "evaluate" and not failed:
        _keep(ended)
    lines = ended.stderr.splitlines()
    errors = [line for line in lines if line.startswith("error: ")]
    return {
        "log": str(ended.task.log),
        "output": None if failed else str(ended.task.output),
        "outcome": outcome,
        "exit_code": ended.exit_code,
        "errors": errors or ([_last_words(verb, ended)] if failed else []),
        "notes": [line for line in lines if line.startswith(("note: ", "warning: "))],
        "result": _document(ended),
    }


def _document(ended: "ProcessEnd") -> object:
    """What a process printed, None if it was killed before that was whole."""
    try:
        return json.loads(ended.stdout)
    except ValueError:
        return None


def _last_words(verb: str, ended: "ProcessEnd") -> str:
    """An error in place of the one that a process did not give."""
    how = f"was killed by signal {-ended.exit_code}" if ended.exit_code < 0 else f"ended with {ended.exit_code}"
    last = f": {ended.stderr.splitlines()[-1]}" if ended.stderr else ""
    return f"error: {ended.task.log}: {verb} {how}{last}"


def _keep(ended: "ProcessEnd") -> None:
    from mcap_landmarks.atomic import atomic_file

    with atomic_file(ended.task.output) as stream:
        stream.write(ended.stdout.encode())


def _print(verb: str, reports: Sequence[_Report], counts: Mapping[str, int]) -> None:
    head = list(_FIGURES[verb]) if verb in _FIGURES else []
    rows = []
    for report in reports:
        result = report["result"]
        figures = [_shown(result, path) for path in _FIGURES.get(verb, {}).values()] if result else ["-"] * len(head)
        rows.append([report["log"], report["outcome"], *figures, report["output"] or "-"])
    table(["log", "outcome", *head, "output"], rows)
    say(", ".join(f"{count} {name}" for name, count in counts.items() if count))


_FIGURES: dict[str, dict[str, tuple[str, ...]]] = {
    "convert": {"messages": ("read",), "lost": ("lost",)},
    "map": {"landmarks": ("landmarks",), "tentative": ("tentative",)},
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
