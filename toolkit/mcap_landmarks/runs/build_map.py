"""Build one landmark map from many logs, and write each log with its results where asked."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from mcap_landmarks.atomic import held
from mcap_landmarks.errors import MapError
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import Manifest
from mcap_landmarks.mapping.built_map import BuiltMap
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.progress import Watch, unwatched
from mcap_landmarks.runs.log_observations import Observed, observe
from mcap_landmarks.runs.map_plan import MapPlan, MapTask, plan_map
from mcap_landmarks.runs.map_results import (
    VERB,
    MappedLog,
    MapRun,
    build_outcome,
    earlier_run,
    why_anew,
    write_log,
    write_part,
)
from mcap_landmarks.runs.original_stamps import trajectory_as_stamped
from mcap_landmarks.runs.outputs import no_empty_folder, output_files
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.replacing import check_apart, check_replaceable, earlier_map, earlier_recording
from mcap_landmarks.runs.session import StageRun, parts_folder
from mcap_landmarks.stages.build_map import STAGE


def build_map(task: MapTask, watch: Watch = unwatched) -> MapRun:
    """Build a map of logs, after the stages that they lack; what is there already is reused.

    Raises:
        ToolkitError: a log or file cannot be used, or what was seen is not enough for a map.
    """
    check_apart([task.database, *task.outputs.values()], task.reads())
    with ExitStack() as stack:
        stack.enter_context(held(task.database))
        parts = task.parts or stack.enter_context(parts_folder(task.database))
        for output in task.outputs.values():
            stack.enter_context(held(output))
        plan = plan_map(task, parts)
        _check_replaceable(plan)
        run = None if task.requests[0].force else earlier_run(plan, parts)
        if run is None:
            run = _build(plan, parts, watch)
        written = [write_log(plan, log, one, parts, watch) for log, one in zip(plan.logs, run.logs, strict=True)]
    return replace(run, logs=tuple(written)).as_named([request.recording for request in task.requests])


def collect_for_map(request: Request, prior: Location | None, parts: Path, watch: Watch = unwatched) -> MappedLog:
    """What one log gives to a map of many: its stages and observations, left among the `parts` of the database.

    Raises:
        ToolkitError: as `build_map`.
    """
    plan = plan_map(MapTask((request,), parts, prior=prior), parts)
    return observe(plan, plan.logs[0], "they are for a map of many logs", parts, watch, is_kept=True).log


def build_map_of(
    requests: Sequence[Request],
    database: Location,
    output: Location | None = None,
    prior: Location | None = None,
    watch: Watch = unwatched,
    parts: Path | None = None,
) -> MapRun:
    """`build_map` of logs, which are written with their results to `output` if there is one; raises the same."""
    if output is None:
        return build_map(MapTask(tuple(requests), database, prior=prior, parts=parts), watch)
    with no_empty_folder(output):
        outputs = output_files([request.recording for request in requests], output)
        return build_map(MapTask(tuple(requests), database, outputs, prior, parts), watch)


def _check_replaceable(plan: MapPlan) -> None:
    """Refuse to replace what is no earlier result of these logs.

    Raises:
        UsageError: as it says.
    """
    task, overwrite = plan.task, plan.task.requests[0].overwrite
    targets, fingerprints = [task.database, *task.outputs.values()], [log.fingerprint for log in plan.logs]
    check_apart(targets, [file for log in plan.logs for step in log.steps for file in step.files.values()])
    check_replaceable(task.database, earlier_map(VERB, fingerprints), overwrite=overwrite)
    for output in task.outputs.values():
        check_replaceable(output, earlier_recording(VERB, fingerprints), overwrite=overwrite)


def _build(plan: MapPlan, parts: Path, watch: Watch) -> MapRun:
    """Run what is missing, gather what every log saw, solve, and write the database."""
    reason, began = why_anew(plan), time.perf_counter()
    seen = [observe(plan, log, reason, parts, watch) for log in plan.logs]
    logs = [one.log for one in seen]
    with watch("solve", None, "steps"):
        built = _solve(plan, logs, seen)
    landmark_map, termination = built.landmark_map, built.termination
    logs = [_told(log, built, i) for i, log in enumerate(logs)]
    for log, trajectory, one in zip(plan.logs, built.trajectories, seen, strict=True):
        if trajectory is not None and log.request.recording in plan.task.outputs:
            write_part(plan, log, landmark_map, trajectory_as_stamped(trajectory, one.shifts_ns), parts)
    others = sum(stage.seconds or 0.0 for log in logs for stage in log.stages)
    seconds = time.perf_counter() - began - others
    build = StageRun(STAGE.name, "ran", reason, build_outcome(plan, termination), seconds)
    run = MapRun(landmark_map, build, tuple(logs), termination)
    fingerprints = tuple(log.fingerprint for log in logs)
    manifest = Manifest(VERB, inputs=fingerprints, options=run.options(), stages=(plan.record,))
    write_map(plan.task.database, landmark_map, manifest.entries())
    return run


def _told(log: MappedLog, built: BuiltMap, row: int) -> MappedLog:
    """A log with the number of its bundles that the map had to leave out, or why it left out all of it."""
    log = replace(log, excluded=built.excluded.get(row, ""))
    left_out = built.left_out[row] if built.left_out else 0
    if not left_out:
        return log
    dropped = {
        **log.outcome.dropped,
        "bundles of pieces of odometry that share too few landmarks with the map": left_out,
    }
    return replace(log, outcome=replace(log.outcome, dropped=dropped))


def _solve(plan: MapPlan, logs: Sequence[MappedLog], seen: Sequence[Observed]) -> BuiltMap:
    """The map, where each log was in it, and how the solver ended.

    Raises:
        MapError: what was seen is not enough, or the solver did not converge.
    """
    prior = read_map(plan.task.prior) if plan.task.prior is not None else None
    try:
        alone = {i: one.alone for i, one in enumerate(seen) if one.alone}
        built: BuiltMap = STAGE.solve([one.observations for one in seen], prior, plan.config, alone)
    except MapError as error:
        raise MapError(f"{_named(logs)}: {error}{_found_by(logs)}") from error
    return built


def _named(logs: Sequence[MappedLog]) -> str:
    """Logs as a reduction counts them."""
    if len(logs) == 1:
        return str(logs[0].recording)
    return ", ".join(f"log {number} ({log.recording})" for number, log in enumerate(logs, 1))


def _found_by(logs: Sequence[MappedLog]) -> str:
    """What the stages before found in all logs, which tells where it went wrong; nothing where none had to run."""
    found = Counter[str]()
    for run in (run for log in logs for run in log.stages):
        found[run.stage] += sum(run.outcome.counts.values())
    counts = ", ".join(f"{stage} {count}" for stage, count in found.items())
    return f" (objects found: {counts})" if counts else ""
