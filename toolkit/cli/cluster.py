"""Find objects in LiDAR scans."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import table
from toolkit.cli.stage_runs import Given, finish, run_over
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.runs.pipeline import LogRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP) with LiDAR scans.")],
    output: options.Output,
    scan: options.ScanTopics = None,
    scan_from: Annotated[
        str | None, typer.Option("--scan-from", metavar="TOPIC", help="Point cloud to take a slice of as the scan.")
    ] = None,
    heights: Annotated[
        str | None,
        typer.Option("--slice", metavar="ZMIN:ZMAX", help="Heights of the slice above the base frame, in metres."),
    ] = None,
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
    if scan and scan_from:
        raise UsageError("--scan-from takes the place of --scan; to merge a scan and a cloud give both with --scan")
    span = options.span(start, end, remap, {"odometry": odom, "scan": [scan_from] if scan_from else scan})
    configured = config_file, [*(settings or []), *_sliced(heights)], method
    given = Given(configured, span, {"extrinsics": extrinsics}, None, results_only, force)
    finish("cluster", run_over("cluster", ["cluster"], logs, output, given), _document, _print, json)


def _sliced(heights: str | None) -> list[str]:
    """The setting that a slice stands for."""
    if heights is None:
        return []
    low, colon, high = heights.partition(":")
    try:
        slice_m = (float(low), float(high)) if colon else (0.0, 0.0)
    except ValueError:
        slice_m = (0.0, 0.0)
    if not slice_m[0] < slice_m[1]:
        raise UsageError(f"--slice {heights}: give two heights in metres, the lower one first, such as 0.1:0.3")
    return [f"cluster.slice_m=[{slice_m[0]}, {slice_m[1]}]"]


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
