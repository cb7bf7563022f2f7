"""Find objects in LiDAR scans."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import table
from toolkit.cli.stage_runs import Given, finish, run_over

if TYPE_CHECKING:
    from toolkit.runs.pipeline import LogRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP) with LiDAR scans.")],
    output: options.Output,
    scan: options.ScanTopics = None,
    scan_from: options.ScanFrom = None,
    heights: options.Slice = None,
    extrinsics: options.Extrinsics = None,
    config_file: options.ConfigFile = None,
    settings: options.Settings = None,
    method: options.Method = None,
    start: options.Start = None,
    end: options.End = None,
    remap: options.Remap = None,
    odom: options.OdometryTopic = None,
    results_only: options.ResultsOnly = False,
    force: options.Force = False,
    json: options.Json = False,
) -> None:
    """Find the objects in the scans of LOG...; write the input with what each could be and where its centre is then."""
    span = options.span(start, end, remap, {"odometry": odom, "scan": options.scans(scan, scan_from)})
    configured = config_file, options.sliced(settings, heights), method
    given = Given(configured, span, {"extrinsics": extrinsics}, None, results_only, force)
    finish("cluster", run_over("cluster", ["cluster"], logs, output, given), _document, _print, json)


def _document(run: "LogRun") -> dict[str, object]:
    return {
        "scans": run.outcome.bundles,
        "unreadable": run.outcome.unreadable,
        "objects": sum(run.outcome.counts.values()),
        "shapes": dict(run.outcome.counts),
    }


def _print(runs: "list[LogRun]") -> None:
    rows = [[str(run.output), str(run.outcome.bundles), str(sum(run.outcome.counts.values()))] for run in runs]
    table(["output", "scans", "objects"], rows)
