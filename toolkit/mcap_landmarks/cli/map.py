"""Build a landmark map from logs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.atomic import check_target
from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, table, warn
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions, SegmentOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, tell, told
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.runs.map_results import MappedLog, MapRun
    from mcap_landmarks.runs.plan import Request
    from mcap_landmarks.runs.session import StageRun


@reading_logs
def command(
    logs: Annotated[
        list[Location], typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP) with odometry.")
    ],
    map_file: options.MapFile,
    images: ImageOptions,
    scans: ScanOptions,
    given: LogOptions,
    segments: SegmentOptions,
    output: options.MaybeOutput = None,
    from_reference: Annotated[
        bool, typer.Option("--from-reference", help="Take the map from LOG's /ground_truth/objects (a surveyed map).")
    ] = False,
    prior: Annotated[
        Location | None, typer.Option("--prior", parser=location, help="Landmark database to extend and refine.")
    ] = None,
    use: options.Use = None,
    extrinsics: options.Extrinsics = None,
    fixed: options.Fixed = False,
    parts: Annotated[str | None, typer.Option("--parts", hidden=True)] = None,
    collect: Annotated[bool, typer.Option("--collect", hidden=True)] = False,
) -> None:
    """Build one landmark map from LOG...; with -o also write each log with its results.

    Where a log has no scene objects, they are made first, from images and scans. The order of the logs does not matter;
    of three or more, one that does not fit the others is left out and named.
    """
    database = check_target(map_file)
    if from_reference:
        _from_reference(logs, database, given)
        return
    asked = Given(given, images, scans, {"extrinsics": extrinsics}, use, ["build_map.fixed=true"] * fixed, segments)
    left = None if parts is None else Path(parts)  # by `batch map`, on this machine
    if collect and left is not None:
        _collect(asked.requests(logs)[0], prior, left, given)
        return
    from mcap_landmarks.runs.build_map import build_map_of

    run = build_map_of(asked.requests(logs), database, output, prior, progress, left)
    for log in run.logs:
        tell(log.recording, _stages(run, log), log.outcome.notes, log.outcome.losses)
        if log.excluded:
            warn(f"warning: {log.recording}: left out of the map: {log.excluded}")
    tell(map_file, (), run.build.outcome.notes, ())
    if given.json:
        say_json("map", _document(run, database))
    else:
        _print(run, database)
    if any(log.outcome.losses or log.excluded for log in run.logs):
        raise typer.Exit(PARTIAL)


def _collect(request: "Request", prior: Location | None, parts: Path, given: LogOptions) -> None:
    """Leave what one log gives to a map of many in a folder, for `batch map`."""
    from mcap_landmarks.runs.build_map import collect_for_map

    log = collect_for_map(request, prior, parts, progress)
    tell(log.recording, log.stages, log.outcome.notes, log.outcome.losses)
    if given.json:
        found = {"path": str(log.recording), "fingerprint": log.fingerprint, "bundles": log.outcome.bundles}
        say_json("map_log", {**found, **told(log.stages), "losses": list(log.outcome.losses)})
    if log.outcome.losses:
        raise typer.Exit(PARTIAL)


def _from_reference(logs: list[Location], database: Location, given: LogOptions) -> None:
    from mcap_landmarks.runs.reference_map import map_from_reference

    if len(logs) != 1:
        raise UsageError("--from-reference takes one log; name just that one")
    landmark_map = map_from_reference(logs[0], database, overwrite=given.overwrite)
    if given.json:
        say_json(
            "map", {"database": str(database), "landmarks": len(landmark_map), "tentative": 0, "logs": [], "stages": {}}
        )
    else:
        say(f"{database}: {counted(len(landmark_map), 'surveyed landmark')} from {logs[0]}")


def _stages(run: "MapRun", log: "MappedLog") -> "list[StageRun]":
    """What every stage did for a log, its share in the map included."""
    import dataclasses

    return [*log.stages, dataclasses.replace(run.build, outcome=log.outcome)]


def _document(run: "MapRun", database: Location) -> dict[str, object]:
    import dataclasses

    tentative = int(run.landmark_map.tentative.sum())
    states: dict[str, str] = {}
    for log in run.logs:
        for stage in _stages(run, log):
            states[stage.stage] = "ran" if "ran" in {stage.state, states.get(stage.stage)} else "reused"
    return {
        "database": str(database),
        "landmarks": len(run.landmark_map) - tentative,
        "tentative": tentative,
        "logs": [
            {
                "path": str(log.recording),
                "fingerprint": log.fingerprint,
                "bundles": source.bundles,
                "used": source.used,
                **told(_stages(run, log)),
                "losses": list(log.outcome.losses),
                **({"excluded": log.excluded} if log.excluded else {}),
            }
            for log, source in zip(run.logs, run.sources, strict=True)
        ],
        "stages": states,
        **({"solver": dataclasses.asdict(run.termination)} if run.termination else {}),
    }


def _print(run: "MapRun", database: Location) -> None:
    tentative = int(run.landmark_map.tentative.sum())
    say(f"{database}: {counted(len(run.landmark_map) - tentative, 'landmark')}, {tentative} tentative")
    rows = [
        [str(log.recording), str(source.bundles), str(source.used)]
        for log, source in zip(run.logs, run.sources, strict=True)
    ]
    table(["log", "bundles", "used"], rows)
