"""Run stages over logs, and only those whose results are not there yet."""

from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, table
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions, SegmentOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, finish, run_over
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.runs.pipeline import LogRun


def _stages_help() -> str:
    """The help of --stages: which there are, those of installed packages included; nothing of them is loaded."""
    from mcap_landmarks.extensions import names_in

    brought = names_in("mcap_landmarks.stages")
    return f"Stages, such as detect,cluster,fuse,localize{'; installed are ' * bool(brought)}{', '.join(brought)}."


@reading_logs
def command(
    logs: Annotated[list[Location], typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP).")],
    stages: Annotated[str, typer.Option("--stages", metavar="NAME,...", help=_stages_help())],
    output: options.Output,
    images: ImageOptions,
    scans: ScanOptions,
    given: LogOptions,
    segments: SegmentOptions,
    map_file: options.MaybeMapFile = None,
    names: options.Names = None,
    extrinsics: options.Extrinsics = None,
) -> None:
    """Run exactly these stages over LOG...; write the input with the results of all stages, earlier ones included."""
    asked = [name.strip() for name in stages.split(",") if name.strip()]
    if not asked:
        raise UsageError("--stages names none; write for example --stages detect,cluster,fuse")
    files = {"map": map_file, "names": names, "extrinsics": extrinsics}
    runs = run_over("run", asked, logs, output, Given(given, images, scans, files, segments=segments))
    finish("run", runs, _document, _print, given.json)


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
