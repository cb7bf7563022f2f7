"""Fuse detections in images with objects in scans."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, table
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, finish, run_over
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.runs.pipeline import LogRun


@reading_logs
def command(
    logs: Annotated[
        list[Location],
        typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP) with detections and scan objects."),
    ],
    output: options.Output,
    given: LogOptions,
    extrinsics: options.Extrinsics = None,
    image: options.ImageTopics = None,
) -> None:
    """Give the objects in the scans of LOG... the classes that its detections have; write the input with scenes."""
    runs = run_over(
        "fuse", ["fuse"], logs, output, Given(given, ImageOptions(image=image), files={"extrinsics": extrinsics})
    )
    finish("fuse", runs, _document, _print, given.json)


def _document(run: "LogRun") -> dict[str, object]:
    return {
        "scans": run.outcome.bundles,
        "unreadable": run.outcome.unreadable,
        "objects": sum(run.outcome.counts.values()),
        "classes": dict(run.outcome.counts),
    }


def _print(runs: "list[LogRun]") -> None:
    rows = [[str(run.output), str(run.outcome.bundles), str(sum(run.outcome.counts.values()))] for run in runs]
    table(["output", "scans", "objects"], rows)
    for run in runs:
        classes = ", ".join(f"{count} {name}" for name, count in run.outcome.counts.items())
        say(f"{run.output}: {classes or 'nothing'}")
