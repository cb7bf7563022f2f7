"""Build a landmark map from logs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import options
from toolkit.cli.console import PARTIAL, progress, say, say_json, table, warn
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.runs.bundles import Span
    from toolkit.runs.mapping import MapRun


def command(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Recordings (MCAP) with odometry.")],
    map_file: options.MapFile,
    output: options.MaybeOutput = None,
    from_reference: Annotated[
        bool, typer.Option("--from-reference", help="Take the map from LOG's /ground_truth/objects (a surveyed map).")
    ] = False,
    prior: Annotated[Path | None, typer.Option("--prior", help="Landmark database to extend and refine.")] = None,
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
    """Build one landmark map from LOG...; with -o also write each log with its results."""
    if from_reference:
        _from_reference(logs, map_file, json)
        return
    span = options.span(start, end, remap, {"odometry": odom})
    run = _build(logs, map_file, prior, (config_file, settings or [], method), span, output, results_only)
    for log in run.logs:
        for reason, count in log.reading.notes().items():
            warn(f"note: {log.path}: {count} {reason}")
        for loss in log.reading.losses:
            warn(f"warning: {log.path}: {loss}")
    if json:
        say_json("map", _document(run, map_file))
    else:
        _print(run, map_file)
    if any(log.reading.losses for log in run.logs):
        raise typer.Exit(PARTIAL)


def _build(
    logs: list[Path],
    map_file: Path,
    prior: Path | None,
    configured: tuple[Path | None, list[str], str | None],
    span: "Span",
    output: Path | None,
    results_only: bool,
) -> "MapRun":
    from toolkit.atomic import check_target
    from toolkit.landmarks.database import read_map
    from toolkit.runs.config import gather, load
    from toolkit.runs.mapping import collect_log, solve_map, write_log
    from toolkit.runs.outputs import output_files
    from toolkit.stage import Reduction
    from toolkit.stages import find_stage

    stage = find_stage("build_map")
    assert isinstance(stage, Reduction)  # noqa: S101 - build_map is the one reduction
    config = load("build_map", gather(*configured))
    check_target(map_file)
    targets = output_files(logs, output) if output else {}
    collected = []
    for log in logs:
        with progress(f"read {log.name}", log.stat().st_size if log.is_file() else None) as advance:
            collected.append(collect_log(stage, config, log, span, advance))
    with progress("solve", None, "steps"):
        run = solve_map(stage, config, collected, read_map(prior) if prior else None, map_file)
    for index, target in enumerate(targets.values()):
        write_log(stage, config, run, index, span, target, results_only=results_only)
    return run


def _from_reference(logs: list[Path], map_file: Path, json: bool) -> None:
    from toolkit.runs.mapping import map_from_reference

    if len(logs) != 1:
        raise UsageError("--from-reference takes one log")
    landmark_map = map_from_reference(logs[0], map_file)
    if json:
        say_json(
            "map", {"database": str(map_file), "landmarks": len(landmark_map), "tentative": 0, "logs": [], "stages": {}}
        )
    else:
        say(f"{map_file}: {len(landmark_map)} surveyed landmarks from {logs[0]}")


def _document(run: "MapRun", map_file: Path) -> dict[str, object]:
    tentative = int(run.landmark_map.tentative.sum())
    return {
        "database": str(map_file),
        "landmarks": len(run.landmark_map) - tentative,
        "tentative": tentative,
        "logs": [
            {
                "path": str(log.path),
                "fingerprint": log.fingerprint,
                "bundles": source.bundles,
                "used": source.used,
                "dropped": log.reading.notes(),
                "losses": log.reading.losses,
            }
            for log, source in zip(run.logs, run.landmark_map.sources[-len(run.logs) :], strict=True)
        ],
        "stages": {"build_map": "ran"},
    }


def _print(run: "MapRun", map_file: Path) -> None:
    tentative = int(run.landmark_map.tentative.sum())
    say(f"{map_file}: {len(run.landmark_map) - tentative} landmarks, {tentative} tentative")
    sources = run.landmark_map.sources[-len(run.logs) :]
    rows = [[str(log.path), str(s.bundles), str(s.used)] for log, s in zip(run.logs, sources, strict=True)]
    table(["log", "bundles", "used"], rows)
