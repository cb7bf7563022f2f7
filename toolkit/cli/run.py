"""Run stages over logs, and only those whose results are not there yet."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import say, table
from toolkit.cli.stage_runs import Given, finish, run_over
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.runs.pipeline import LogRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP).")],
    stages: Annotated[
        str, typer.Option("--stages", metavar="NAME,...", help="Stages, such as detect,cluster,fuse,localize.")
    ],
    output: options.Output,
    map_file: options.MaybeMapFile = None,
    model: options.Model = None,
    names: options.Names = None,
    extrinsics: options.Extrinsics = None,
    config_file: options.ConfigFile = None,
    settings: options.Settings = None,
    method: options.Method = None,
    start: options.Start = None,
    end: options.End = None,
    remap: options.Remap = None,
    odom: options.OdometryTopic = None,
    scan: options.ScanTopics = None,
    scan_from: options.ScanFrom = None,
    heights: options.Slice = None,
    image: options.ImageTopic = None,
    image_rate: options.ImageRate = None,
    every: options.Every = None,
    results_only: options.ResultsOnly = False,
    force: options.Force = False,
    json: options.Json = False,
) -> None:
    """Run exactly these stages over LOG...; write the input with the results of all stages, earlier ones included."""
    asked = [name.strip() for name in stages.split(",") if name.strip()]
    if not asked:
        raise UsageError("--stages names none; write for example --stages detect,cluster,fuse")
    span = options.span(start, end, remap, {"odometry": odom, "scan": options.scans(scan, scan_from), "image": image})
    files = {"map": map_file, "model": model, "names": names, "extrinsics": extrinsics}
    configured, thinning = (config_file, options.sliced(settings, heights), method), options.thinning(image_rate, every)
    given = Given(configured, span, files, thinning, results_only, force)
    finish("run", run_over("run", asked, logs, output, given), _document, _print, json)


def _document(run: "LogRun") -> dict[str, object]:
    return {
        "results": {
            stage.stage: {
                "bundles": stage.outcome.bundles,
                "unreadable": stage.outcome.unreadable,
                "counts": dict(stage.outcome.counts),
            }
            for stage in run.stages
        }
    }


def _print(runs: "list[LogRun]") -> None:
    for run in runs:
        say(str(run.output))
        rows = [
            [
                stage.stage,
                stage.state,
                str(stage.outcome.bundles),
                ", ".join(f"{count} {name}" for name, count in stage.outcome.counts.items()),
            ]
            for stage in run.stages
        ]
        table(["stage", "", "bundles", "results"], rows)
