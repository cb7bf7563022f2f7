"""Build one landmark map from many logs, and write each log with its results where asked."""

import dataclasses
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.channels import MAP_MARKERS, MAP_PATH, MAP_POSE
from mcap_landmarks.config import load
from mcap_landmarks.errors import MapError, RecordingError, UsageError
from mcap_landmarks.manifest import RUN, Manifest, Outcome, StageRecord, stage_records
from mcap_landmarks.mapping.observations import LogObservations, Trajectory
from mcap_landmarks.maps.database import read_manifest, read_map, write_map
from mcap_landmarks.maps.markers import markers_from_map
from mcap_landmarks.maps.model import LandmarkMap, Source
from mcap_landmarks.messages.poses import Path as PathMessage
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.bundles import inputs_of
from mcap_landmarks.runs.needed_stages import missing_stages
from mcap_landmarks.runs.output_writer import write_output
from mcap_landmarks.runs.pipeline import check_output, told
from mcap_landmarks.runs.plan import (
    Request,
    Step,
    choice_options,
    inputs_of_stage,
    is_result,
    plan,
    record_of,
)
from mcap_landmarks.runs.session import Session, StageRun, open_session, part_file, parts_folder
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.stage_runner import outcome_of
from mcap_landmarks.stage import Config, Reduction, Stamped, Watch, unwatched
from mcap_landmarks.stages.build_map import STAGE

_LOGS = "logs"
"""The manifest's option with what came of each log: of the stages before, then of the map."""


@dataclass(frozen=True, slots=True)
class MapTask:
    """The logs of a map (their settings are the first one's), the database, each log's output, a map to extend."""

    requests: tuple[Request, ...]
    database: Path
    outputs: Mapping[Path, Path] = field(default_factory=dict)
    prior: Path | None = None

    @property
    def files(self) -> dict[str, Path]:
        """The files that the map is made with."""
        return {"prior": self.prior} if self.prior is not None else {}


@dataclass(frozen=True, slots=True)
class MappedLog:
    """What became of one log on its way into a map; `outcome` counts its bundles and all that was lost."""

    recording: Path
    fingerprint: str
    stages: tuple[StageRun, ...]
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class MapRun:
    """The map, what became of it, and what became of each log."""

    landmark_map: LandmarkMap
    build: StageRun
    logs: tuple[MappedLog, ...]

    @property
    def sources(self) -> tuple[Source, ...]:
        """What the map says of the logs, in their order."""
        return self.landmark_map.sources[len(self.landmark_map.sources) - len(self.logs) :]


@dataclass(frozen=True, slots=True)
class _LogPlan:
    """One log on its way: its place among the logs, its steps up to the scene objects, what the map will read of it."""

    place: str
    request: Request
    fingerprint: str
    steps: tuple[Step, ...]
    record: StageRecord


def build_map(task: MapTask, watch: Watch = unwatched) -> MapRun:
    """Build a map of logs, after the stages that they lack; what is there already is reused.

    Raises:
        ToolkitError: a log or file cannot be used, or what was seen is not enough for a map.
    """
    stage, config = STAGE, load(STAGE.name, task.requests[0].settings)
    check_target(task.database)
    for recording, output in task.outputs.items():
        check_output(recording, output)
    with parts_folder(task.database) as parts:
        plans = [
            _plan_log(f"log {number}", stage, config, request, task, parts)
            for number, request in enumerate(task.requests, 1)
        ]
        _check_each_once(plans)
        inputs = {entry.place: entry.record.key for entry in plans}
        record = record_of(stage, config, task.files, inputs, {})
        run = None if task.requests[0].force else _found(task, plans, record, parts)
        if run is None:
            run = _build(stage, config, task, plans, record, parts, watch)
        written = [
            _write_log(task, plans, entry, log, record, parts, watch) if log.recording in task.outputs else log
            for entry, log in zip(plans, run.logs, strict=True)
        ]
    return dataclasses.replace(run, logs=tuple(written))


def _plan_log(place: str, stage: Reduction, config: Config, request: Request, task: MapTask, parts: Path) -> _LogPlan:
    with open_session(request, parts, None) as session:
        log, choice = session.log, request.span.choice
        sensed = [channel for channel in stage.reads if not is_result(channel, choice)]
        inputs_of(log.without_results(), sensed, sensed, choice)  # before hours are spent on the other stages
        steps = tuple(plan(request, log, missing_stages(stage, log, request.use)))
        inputs, options = inputs_of_stage(stage, log, steps), choice_options(choice, stage.reads)
        record = record_of(stage, config, task.files, inputs, options)
        return _LogPlan(place, request, log.recording.fingerprint(), steps, record)


def _check_each_once(plans: Sequence[_LogPlan]) -> None:
    """Refuse a recording that is named twice, also as an output of ours: what it saw would count double."""
    known: dict[str, Path] = {}
    for entry in plans:
        path = entry.request.recording
        if entry.fingerprint in known:
            raise UsageError(f"{path} is the same recording as {known[entry.fingerprint]}; name it once")
        known[entry.fingerprint] = path


def _share(entry: _LogPlan, record: StageRecord) -> StageRecord:
    """The record of one log's share in the map that another record is of."""
    return dataclasses.replace(entry.record, inputs={**entry.record.inputs, entry.place: record.key})


def _found(task: MapTask, plans: Sequence[_LogPlan], record: StageRecord, parts: Path) -> MapRun | None:
    """The run that made the database, if it is the one that is asked for and left its results in all outputs."""
    entries = read_manifest(task.database)
    if _why(entries, record):
        return None
    for entry in plans:
        output = task.outputs.get(entry.request.recording)
        if output is not None:
            with open_session(entry.request, parts, output) as session:
                if session.find(_share(entry, record)) is None:
                    return None
    reason = "the map was made from the same logs, files and settings"
    logs = []
    for entry, (*before, own) in zip(plans, json.loads(entries["options"])[_LOGS], strict=True):
        runs = zip(entry.steps, before, strict=True)
        stages = tuple(StageRun(step.stage.name, "reused", reason, Outcome.of(outcome)) for step, outcome in runs)
        logs.append(MappedLog(entry.request.recording, entry.fingerprint, stages, Outcome.of(own)))
    return MapRun(read_map(task.database), StageRun(record.stage, "reused", reason, Outcome()), tuple(logs))


def _why(entries: Mapping[str, str], record: StageRecord) -> str:
    """Why the map has to be built, in words, from the manifest of the one that is there; empty if it need not be."""
    earlier = stage_records({RUN: entries}).get(record.stage)
    return "there was no such map" if earlier is None else record.difference(earlier)


def _build(
    stage: Reduction,
    config: Config,
    task: MapTask,
    plans: Sequence[_LogPlan],
    record: StageRecord,
    parts: Path,
    watch: Watch,
) -> MapRun:
    """Run what is missing, gather what every log saw, solve, and write the database."""
    reason = "--force" if task.requests[0].force else _why(read_manifest(task.database), record)
    reason = reason or "an output has no results of it"
    logs, observations = [], []
    for entry in plans:
        with open_session(entry.request, parts, task.outputs.get(entry.request.recording)) as session:
            runs = [session.work(step, watch) for step in entry.steps]
            found, outcome = _collect(stage, config, session, entry, watch)
        notes, losses = told([*runs, StageRun(stage.name, "ran", reason, outcome)], [], [])
        outcome = dataclasses.replace(outcome, losses=losses, notes=notes)
        observations.append(found)
        logs.append(MappedLog(entry.request.recording, entry.fingerprint, tuple(runs), outcome))
    with watch("solve", None, "steps"):
        prior = read_map(task.prior) if task.prior is not None else None
        try:
            landmark_map, trajectories = stage.solve(observations, prior, config)
        except MapError as error:
            raise MapError(f"{_named(logs)}: {error}{_found_by(logs)}") from error
    for entry, trajectory in zip(plans, trajectories, strict=True):
        if entry.request.recording in task.outputs:
            _write_part(_share(entry, record), landmark_map, trajectory, parts)
    outcomes = {_LOGS: [[*(run.outcome.entry() for run in log.stages), log.outcome.entry()] for log in logs]}
    fingerprints = tuple(log.fingerprint for log in logs)
    manifest = Manifest("map", inputs=fingerprints, options=outcomes, stages=(record,))
    write_map(task.database, landmark_map, manifest.entries())
    return MapRun(landmark_map, StageRun(stage.name, "ran", reason, Outcome()), tuple(logs))


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
    told = ", ".join(f"{stage} {count}" for stage, count in found.items())
    return f" (objects found: {told})" if told else ""


def _collect(
    stage: Reduction, config: Config, session: Session, entry: _LogPlan, watch: Watch
) -> tuple[LogObservations, Outcome]:
    """Observations of one log.

    Raises:
        RecordingError: it has no scene objects or no odometry, or none of its bundles has odometry.
    """
    log = StageInput(stage, session.log_for(entry.record), session.request.span)
    with watch(f"read {log.path.name}", log.count, "bundles") as progress:
        observations = stage.collect(log.bundles(progress), config)
    log.close()
    if not len(observations.stamps_ns):
        raise RecordingError(
            f"{log.path}: none of {observations.bundles} bundles has odometry within 2 s; check that the clocks of "
            "odometry and scene objects agree"
        )
    return dataclasses.replace(observations, fingerprint=entry.fingerprint), outcome_of(log.reading)


def _write_part(record: StageRecord, landmark_map: LandmarkMap, trajectory: Trajectory, parts: Path) -> None:
    """One log's results of the map as a recording of their own."""
    with create_recording(part_file(parts, record)) as writer:
        for stamped in _results(landmark_map, trajectory):
            writer.add(stamped, record.stage)
        writer.metadata[RUN] = Manifest("part", fingerprint=record.key, stages=(record,)).entries()


def _results(landmark_map: LandmarkMap, trajectory: Trajectory) -> Iterator[Stamped]:
    frame = landmark_map.frame
    poses = [
        PoseStamped.planar(int(stamp), frame, pose)
        for stamp, pose in zip(trajectory.stamps_ns, trajectory.map_from_base, strict=True)
    ]
    first, first_stamp = int(trajectory.log_times_ns[0]), int(trajectory.stamps_ns[0])
    yield Stamped(MAP_MARKERS, first, markers_from_map(landmark_map, first_stamp))
    yield Stamped(MAP_PATH, first, PathMessage(first_stamp, frame, tuple(poses)))
    for log_time_ns, pose in zip(trajectory.log_times_ns, poses, strict=True):
        yield Stamped(MAP_POSE, int(log_time_ns), pose)


def _write_log(
    task: MapTask,
    plans: Sequence[_LogPlan],
    entry: _LogPlan,
    log: MappedLog,
    record: StageRecord,
    parts: Path,
    watch: Watch,
) -> MappedLog:
    """Write one log with all its results; what became of it, with what showed on the way."""
    output, outcome = task.outputs[log.recording], log.outcome
    with open_session(entry.request, parts, output) as session:
        for step in entry.steps:
            if session.find(step.record) is None:
                session.work(step, watch)
        session.find(_share(entry, record))
        notes, losses = write_output(session, output, "map", [other.fingerprint for other in plans], watch)
    notes_told, losses_told = told([StageRun(record.stage, "", "", outcome)], notes, losses)
    return dataclasses.replace(log, outcome=dataclasses.replace(outcome, notes=notes_told, losses=losses_told))
