"""Detect objects in camera images."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, table
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, SegmentOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, finish, run_over
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.runs.pipeline import LogRun


@reading_logs
def command(
    logs: Annotated[
        list[Location], typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP) with camera images.")
    ],
    output: options.Output,
    images: ImageOptions,
    given: LogOptions,
    segments: SegmentOptions,
    names: options.Names = None,
    segment: Annotated[str | None, typer.Option("--segment", hidden=True)] = None,
) -> None:
    """Detect objects in the camera images of LOG...; write the input with detections and annotations."""
    if segment is not None:  # a worker's part of a log that another process cuts
        from mcap_landmarks.runs.segment_worker import run_segment

        run_segment(segment, Path(str(output)))
        return
    runs = run_over("detect", ["detect"], logs, output, Given(given, images, files={"names": names}, segments=segments))
    finish("detect", runs, _document, _print, given.json)


def _document(run: "LogRun") -> dict[str, object]:
    return {
        "images": run.outcome.bundles,
        "unreadable": run.outcome.unreadable,
        "detections": sum(run.outcome.counts.values()),
        "classes": dict(run.outcome.counts),
    }


def _print(runs: "list[LogRun]") -> None:
    rows = [[str(run.output), str(run.outcome.bundles), str(sum(run.outcome.counts.values()))] for run in runs]
    table(["output", "images", "detections"], rows)
    for run in runs:
        classes = ", ".join(f"{count} {name}" for name, count in run.outcome.counts.items())
        say(f"{run.output}: {classes or 'nothing'}")
