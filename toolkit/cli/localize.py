"""Localize logs in a landmark map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import say, table
from toolkit.cli.stage_runs import finish, run_over

if TYPE_CHECKING:
    from toolkit.runs.pipeline import StageRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP).")],
    map_file: options.MapFile,
    output: options.Output,
    config_file: options.ConfigFile = None,
    settings: options.Settings = None,
    method: options.Method = None,
    start: options.Start = None,
    end: options.End = None,
    remap: options.Remap = None,
    odom: options.OdometryTopic = None,
    results_only: options.ResultsOnly = False,
    json: options.Json = False,
) -> None:
    """Localize every bundle of scene objects in LOG... in a landmark map; write the input with pose and match."""
    span = options.span(start, end, remap, {"odometry": odom})
    configured = config_file, settings, method
    finish(
        "localize",
        run_over("localize", logs, output, configured, {"map": map_file}, span, results_only),
        _document,
        _print,
        json,
    )


def _document(run: "StageRun") -> dict[str, object]:
    return {"bundles": run.reading.association.bundles, "statuses": _statuses(run)}


def _statuses(run: "StageRun") -> dict[str, int]:
    from toolkit.messages.match import Status

    return {status.name.lower(): run.counts[status.name.lower()] for status in Status}


def _print(runs: "list[StageRun]") -> None:
    names = list(_statuses(runs[0]))
    rows = []
    for run in runs:
        counts = _statuses(run)
        rows.append([str(run.output), str(run.reading.association.bundles), *(str(counts[name]) for name in names)])
    table(["output", "bundles", *names], rows)
    for run in runs:
        share = run.counts["localized"] / max(run.reading.association.bundles, 1)
        say(f"{run.output}: {run.counts['localized']} bundles localized ({100 * share:.1f} %)")
