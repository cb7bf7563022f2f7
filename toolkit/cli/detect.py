"""Detect objects in camera images."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import say, table
from toolkit.cli.stage_runs import finish, run_over

if TYPE_CHECKING:
    from toolkit.runs.pipeline import StageRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP) with camera images.")],
    output: options.Output,
    model: Annotated[Path | None, typer.Option("--model", help="Detector: any YOLOv5 export (ONNX).")] = None,
    names: Annotated[
        Path | None, typer.Option("--names", help="Class names, one per line, where the model has none.")
    ] = None,
    config_file: options.ConfigFile = None,
    settings: options.Settings = None,
    method: options.Method = None,
    start: options.Start = None,
    end: options.End = None,
    remap: options.Remap = None,
    image: options.ImageTopic = None,
    results_only: options.ResultsOnly = False,
    json: options.Json = False,
) -> None:
    """Detect objects in the camera images of LOG...; write the input with detections and annotations."""
    span = options.span(start, end, remap, {"image": image})
    files = {"model": model, "names": names}
    runs = run_over("detect", logs, output, (config_file, settings, method), files, span, results_only)
    finish("detect", runs, _document, _print, json)


def _document(run: "StageRun") -> dict[str, object]:
    return {
        "images": run.reading.association.bundles,
        "unreadable": run.reading.unreadable.total(),
        "detections": run.counts.total(),
        "classes": dict(sorted(run.counts.items())),
    }


def _print(runs: "list[StageRun]") -> None:
    rows = [[str(run.output), str(run.reading.association.bundles), str(run.counts.total())] for run in runs]
    table(["output", "images", "detections"], rows)
    for run in runs:
        classes = ", ".join(f"{count} {name}" for name, count in sorted(run.counts.items()))
        say(f"{run.output}: {classes or 'nothing'}")
