"""Find objects in LiDAR scans."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import table
from mcap_landmarks.cli.option_groups import LogOptions, ScanOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, finish, run_over
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.runs.pipeline import LogRun


@reading_logs
def command(
    logs: Annotated[
        list[Location], typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP) with LiDAR scans.")
    ],
    output: options.Output,
    scans: ScanOptions,
    given: LogOptions,
    extrinsics: options.Extrinsics = None,
) -> None:
    """Find the objects in the scans of LOG...; write the input with what each could be and where its centre is then."""
    asked = Given(given, scans=scans, files={"extrinsics": extrinsics})
    finish("cluster", run_over("cluster", ["cluster"], logs, output, asked), _document, _print, given.json)


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
