"""Detect objects in camera images."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import say, table
from toolkit.cli.stage_runs import Given, finish, run_over

if TYPE_CHECKING:
    from toolkit.runs.pipeline import LogRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP) with camera images.")],
    output: options.Output,
    model: options.Model = None,
    names: options.Names = None,
    config_file: options.ConfigFile = None,
    settings: options.Settings = None,
    method: options.Method = None,
    start: options.Start = None,
    end: options.End = None,
    remap: options.Remap = None,
    image: options.ImageTopic = None,
    odom: options.OdometryTopic = None,
    image_rate: options.ImageRate = None,
    every: options.Every = None,
    results_only: options.ResultsOnly = False,
    force: options.Force = False,
    json: options.Json = False,
) -> None:
    """Detect objects in the camera images of LOG...; write the input with detections and annotations."""
    span = options.span(start, end, remap, {"image": image, "odometry": odom})
    files, thinning = {"model": model, "names": names}, options.thinning(image_rate, every)
    given = Given((config_file, settings, method), span, files, thinning, results_only, force)
    finish("detect", run_over("detect", ["detect"], logs, output, given), _document, _print, json)


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
