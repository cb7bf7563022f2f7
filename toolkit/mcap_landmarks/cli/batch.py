"""Run a verb over many logs, with workers that outlast what becomes of a log."""

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.batch_map import map_logs
from mcap_landmarks.cli.batch_options import BatchOptions
from mcap_landmarks.cli.batch_reports import Report, counts_of, print_reports, say_errors
from mcap_landmarks.cli.batch_tasks import VERBS, tasks_of
from mcap_landmarks.cli.console import PARTIAL, UNUSABLE, say_json, warn
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.fleet.tasks import Task

context_settings = {"allow_extra_args": True, "ignore_unknown_options": True}


def command(
    verb: Annotated[str, typer.Argument(metavar="VERB", help=", ".join(VERBS) + ".")],
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="MANIFEST|GLOB|PREFIX... [OPTIONS OF VERB]",
            help="Logs: by name, quoted pattern ('logs/**/*.mcap'), prefix of URLs (s3://bucket/logs/), or listed in a "
            "TOML file.",
        ),
    ],
    output: Annotated[
        Location, typer.Option("-o", "--output", parser=location, help="Folder for the results, named as their logs.")
    ],
    batch: BatchOptions,
    json: options.Json = False,
) -> None:
    """Run VERB over every log; one that fails, hangs or is killed does not stop the others.

    Of all logs `map` makes one map: map.db in the folder, or what --map says. Options of VERB pass through:
    batch localize 'logs/*.mcap' --map m.db -o out --set localize.max_sigma_m=0.3
    """
    from mcap_landmarks.cli.batch_catalogue import batch_rows
    from mcap_landmarks.cli.batch_events import event_lines
    from mcap_landmarks.cli.batch_run import run_batch
    from mcap_landmarks.cli.batch_table import live_table
    from mcap_landmarks.runs.outputs import no_empty_folder

    if batch.prints_events and json:
        raise UsageError("--events - and --json both print to stdout; give --events a file")
    if verb == "map":
        with no_empty_folder(output):
            map_logs(words, output, batch, prints_json=json)
        return
    limits = batch.limits()
    with no_empty_folder(output):
        tasks, began = tasks_of(verb, words, output), time.monotonic()
        with (
            batch_rows(batch.catalogue, tasks) as rows,
            event_lines(batch.events) as lines,
            live_table(verb, len(tasks)) as shown,
        ):
            reports = run_batch(verb, tasks, batch.crew(tasks), limits, [lines, shown, rows])
    took_s = time.monotonic() - began
    for report in reports:
        for note in report["notes"]:
            warn(note)
    counts = counts_of(reports)
    if json:
        say_json("batch", {"verb": verb, **counts, "logs": reports})
    elif not batch.prints_events:
        print_reports(verb, reports, counts)
        _tell_pace(tasks, reports, took_s)
    say_errors(reports)
    if counts["failed"] == len(reports):
        raise typer.Exit(UNUSABLE)
    if counts["failed"] or counts["partial"] or rows.is_lost:
        raise typer.Exit(PARTIAL)


def _tell_pace(tasks: "Sequence[Task]", reports: Sequence[Report], took_s: float) -> None:
    from mcap_landmarks.cli.batch_table import say_pace
    from mcap_landmarks.fleet.recorded_time import recorded_s

    pairs = zip(tasks, reports, strict=True)
    say_pace(recorded_s(task for task, report in pairs if report["outcome"] in {"done", "partial"}), took_s)
