"""Localize logs in a landmark map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import PARTIAL, progress, say, say_json, table, warn

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
    from toolkit.runs.config import gather, load
    from toolkit.runs.outputs import output_files
    from toolkit.runs.pipeline import Job, run_stage
    from toolkit.stage import Stage
    from toolkit.stages import find_stage

    config = load("localize", gather(config_file, settings or [], method))
    span = options.span(start, end, remap, {"odometry": odom})
    stage = find_stage("localize")
    assert isinstance(stage, Stage)  # noqa: S101 - localize is no reduction
    runs = []
    for log, target in output_files(logs, output).items():
        with progress(f"localize {log.name}", log.stat().st_size if log.is_file() else None) as advance:
            runs.append(run_stage(stage, config, Job(log, target, {"map": map_file}, span, results_only), advance))
    for run in runs:
        _report(run)
    if json:
        say_json("localize", _document(runs))
    else:
        _print(runs)
    if any(run.reading.losses for run in runs):
        raise typer.Exit(PARTIAL)


def _report(run: "StageRun") -> None:
    for note in run.notes:
        warn(f"note: {note}")
    for reason, count in run.reading.notes().items():
        warn(f"note: {run.output}: {count} {reason}")
    for loss in run.reading.losses:
        warn(f"warning: {run.output}: {loss}")


def _document(runs: "list[StageRun]") -> dict[str, object]:
    """One document; several logs are summed, and listed under `logs`."""
    each = [
        {
            "output": str(run.output),
            "bundles": run.reading.association.bundles,
            "statuses": _statuses(run),
            "stages": {"localize": "ran"},
            "dropped": run.reading.notes(),
            "losses": run.reading.losses,
        }
        for run in runs
    ]
    return each[0] if len(each) == 1 else {"logs": each}


def _statuses(run: "StageRun") -> dict[str, int]:
    from toolkit.messages.match import Status

    return {status.name.lower(): run.statuses[status.name.lower()] for status in Status}


def _print(runs: "list[StageRun]") -> None:
    names = list(_statuses(runs[0]))
    rows = []
    for run in runs:
        counts = _statuses(run)
        rows.append([str(run.output), str(run.reading.association.bundles), *(str(counts[name]) for name in names)])
    table(["output", "bundles", *names], rows)
    for run in runs:
        share = run.statuses["localized"] / max(run.reading.association.bundles, 1)
        say(f"{run.output}: {run.statuses['localized']} bundles localized ({100 * share:.1f} %)")
