"""One landmark map of a batch's logs: workers gather what each gives to it, then this process solves it."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mcap_landmarks.cli.batch_catalogue import BatchRows, batch_rows
from mcap_landmarks.cli.batch_checks import check_logs, check_values
from mcap_landmarks.cli.batch_options import BatchOptions
from mcap_landmarks.cli.batch_reports import Report, counts_of, print_reports, say_errors
from mcap_landmarks.cli.batch_tasks import ONE_THREAD, split, word
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, say, say_json, warn
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.fleet.inputs import FleetLog
    from mcap_landmarks.fleet.tasks import Ended, Task

_NAME = "map.db"


def map_logs(words: Sequence[str], output: Location, batch: BatchOptions, *, prints_json: bool) -> None:
    """Build the map of all logs that can be read; those that cannot, or that do not fit the others, are named.

    What the logs gave stays beside the map as long as one of them failed, so that the next try begins there.

    Raises:
        UsageError: an option, a manifest or an output makes no sense.
        typer.Exit: a log failed or does not fit, or there is no map.
    """
    from mcap_landmarks.fleet.inputs import find_logs
    from mcap_landmarks.runs.outputs import make_folder
    from mcap_landmarks.runs.session import parts_folder

    own, names, passed = split("map", words)
    logs = find_logs(names)
    check_logs("map", own, logs)
    database, options = _database((*_of_all(logs), *passed), make_folder(output))
    words_of_one = (word(logs[0].place), "--map", word(database), *options)
    check_values("map", own, words_of_one, logs[0], passed)
    with parts_folder(database) as parts:
        tasks = _tasks(logs, database, parts, options)
        with batch_rows(batch.catalogue, tasks) as rows:
            reports = _gathered(tasks, batch, rows)
            solved = _solved(_good(tasks, reports), database, parts, options)
            if solved is not None and solved.exit_code in {DONE, PARTIAL}:
                rows.add_map(database, _document(solved))
        for line in dict.fromkeys(_lines(reports, solved)):
            warn(line)
        if prints_json or not batch.prints_events:
            _show(reports, solved, prints_json=prints_json)
        say_errors(reports)
        _end(reports, solved, parts)
    codes = [solved.exit_code if solved else DONE, *(report["exit_code"] for report in reports)]
    if rows.is_lost or any(code != DONE for code in codes):
        raise typer.Exit(PARTIAL)


def _end(reports: Sequence[Report], solved: "Ended | None", parts: Path) -> None:
    """End with what became of all; the block where the parts lie goes well only if no log failed.

    Raises:
        typer.Exit: there is no map, or a log failed.
    """
    if solved is None or solved.exit_code not in {DONE, PARTIAL}:
        raise typer.Exit(solved.exit_code if solved is not None else UNUSABLE)
    if any(report["outcome"] == "failed" for report in reports):
        warn(f"note: {parts}: what the other logs gave stays here for the next run")
        raise typer.Exit(PARTIAL)


def _database(passed: Sequence[str], folder: Location) -> tuple[Location, tuple[str, ...]]:
    """Where the map goes, and the options without that."""
    database, options = folder / _NAME, list[str]()
    rest = iter(passed)
    for given in rest:
        name, equals, value = given.partition("=")
        if name == "--map":
            database = location(value if equals else next(rest, ""))
        else:
            options.append(given)
    return database, (*ONE_THREAD, *options)


def _of_all(logs: "Sequence[FleetLog]") -> tuple[str, ...]:
    """The options that a manifest gives to all logs.

    Raises:
        UsageError: it gives them others, though they are for one map.
    """
    from mcap_landmarks.fleet.fleet_manifest import words_of

    options = {words_of(log.options) for log in logs}
    if len(options) > 1:
        raise UsageError("batch map makes one map, with the same options for all logs; give them under [options]")
    return options.pop()


def _tasks(logs: "Sequence[FleetLog]", database: Location, parts: Path, options: Sequence[str]) -> "list[Task]":
    """What workers do: one log each."""
    from mcap_landmarks.fleet.tasks import Task

    where = ("--map", word(database), "--parts", str(parts), "--collect", "--json")
    return [Task(log.place, database, ("map", word(log.place), *where, *options)) for log in logs]


def _gathered(tasks: "Sequence[Task]", batch: BatchOptions, rows: BatchRows) -> list[Report]:
    from mcap_landmarks.cli.batch_events import event_lines
    from mcap_landmarks.cli.batch_run import run_batch
    from mcap_landmarks.cli.batch_table import live_table

    with event_lines(batch.events) as lines, live_table("map", len(tasks)) as shown:
        return run_batch("map", tasks, batch.crew(tasks), batch.limits(), [lines, shown, rows])


def _good(tasks: "Sequence[Task]", reports: Sequence[Report]) -> "list[Task]":
    return [task for task, report in zip(tasks, reports, strict=True) if report["outcome"] != "failed"]


def _solved(tasks: "Sequence[Task]", database: Location, parts: Path, options: Sequence[str]) -> "Ended | None":
    """The map of the logs whose parts are there, by the words that make it in one process; None without a log."""
    if not tasks:
        return None
    from mcap_landmarks.cli.main import run
    from mcap_landmarks.fleet.tasks import Task
    from mcap_landmarks.fleet.worker import run_task

    warn(f"{database}: solving the map of {counted(len(tasks), 'log')}")
    logs = [word(task.log) for task in tasks]
    kept = [option for option in options if option != "--force"]  # workers have made the parts anew
    where = ("--map", word(database), "--parts", str(parts), "--json")
    return run_task(Task(database, database, ("map", *logs, *where, *kept)), run)


def _lines(reports: Sequence[Report], solved: "Ended | None") -> Iterator[str]:
    for report in reports:
        yield from report["notes"]
    if solved is not None:
        yield from (line for line in solved.stderr.splitlines() if line.startswith(("note: ", "warning: ", "error: ")))


def _document(solved: "Ended | None") -> dict[str, object] | None:
    """The map's own document."""
    try:
        found: dict[str, object] | None = json.loads(solved.stdout) if solved is not None else None
    except ValueError:
        return None
    return found


def _show(reports: Sequence[Report], solved: "Ended | None", *, prints_json: bool) -> None:
    """What became of the logs and of the map, on stdout."""
    counts, document = counts_of(reports), _document(solved)
    if prints_json:
        say_json("batch", {"verb": "map", **counts, "logs": reports, **({"map": document} if document else {})})
        return
    print_reports("map", reports, counts)
    if document is not None and "database" in document:
        landmarks, tentative = int(str(document["landmarks"])), document["tentative"]
        say(f"{document['database']}: {counted(landmarks, 'landmark')}, {tentative} tentative")
