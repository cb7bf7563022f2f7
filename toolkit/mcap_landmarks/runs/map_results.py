"""What became of a landmark map: found again where it was built before, and written to the logs that it is made of."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from mcap_landmarks.channels import MAP_MARKERS, MAP_PATH, MAP_POSE
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, Manifest, Outcome, stage_records
from mcap_landmarks.mapping.built_map import LogTrajectory
from mcap_landmarks.maps.database import read_manifest, read_map
from mcap_landmarks.maps.map_markers import markers_from_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.poses import Path as PathMessage
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.progress import Watch
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.map_plan import LogPlan, MapPlan
from mcap_landmarks.runs.output_writer import write_output
from mcap_landmarks.runs.pipeline import told
from mcap_landmarks.runs.session import StageRun, open_session, part_file
from mcap_landmarks.stage import Stamped
from mcap_landmarks.wording import counted

VERB = "map"
"""What the manifests of a map and of its logs call what made them."""
_LOGS = "logs"
"""The manifest's option with what came of each log: of the stages before, then of the map."""
_EXCLUDED = "excluded"
"""The manifest's option with the logs that are no part of the map, by fingerprint, and why."""
_SOLVER = "solver"
"""The manifest's option with how the solver ended."""


@dataclass(frozen=True, slots=True)
class MappedLog:
    """What became of one log on its way into a map; `outcome` counts its bundles and all that was lost.

    `excluded` says why it is no part of the map; empty if it is.
    """

    recording: Location
    fingerprint: str
    stages: tuple[StageRun, ...]
    outcome: Outcome
    excluded: str = ""


@dataclass(frozen=True, slots=True, repr=False)
class MapRun:
    """The map, what became of it and of each log, and how the solver ended; None where the method solves nothing.

    The logs come in the order in which they were named.
    """

    landmark_map: LandmarkMap
    build: StageRun
    logs: tuple[MappedLog, ...]
    termination: Termination | None

    def __repr__(self) -> str:
        return f"<MapRun of {counted(len(self.logs), 'log')}: {self.landmark_map!r}, {self.build.state}>"

    @property
    def losses(self) -> tuple[str, ...]:
        """What could not be read of the logs, in words."""
        return tuple(f"{log.recording}: {loss}" for log in self.logs for loss in log.outcome.losses)

    @property
    def sources(self) -> tuple[MapSource, ...]:
        """What the map says of the logs, in their order; of one that is no part of it no bundle was used."""
        told = {source.fingerprint: source for source in self.landmark_map.sources}
        return tuple(
            MapSource("recording", log.fingerprint, log.outcome.bundles, 0) if log.excluded else told[log.fingerprint]
            for log in self.logs
        )

    def as_named(self, recordings: Sequence[Location]) -> "MapRun":
        """The run with its logs in the order of these recordings."""
        logs = {log.recording: log for log in self.logs}
        return replace(self, logs=tuple(logs[recording] for recording in recordings))

    def options(self) -> dict[str, object]:
        """What the manifest keeps of the run, so that `earlier_run` finds it again."""
        logs = [[*(run.outcome.entry() for run in log.stages), log.outcome.entry()] for log in self.logs]
        excluded = {log.fingerprint: log.excluded for log in self.logs if log.excluded}
        told: dict[str, object] = {_LOGS: logs, _SOLVER: asdict(self.termination) if self.termination else None}
        return {**told, _EXCLUDED: excluded} if excluded else told


def earlier_run(plan: MapPlan, parts: Path) -> MapRun | None:
    """The run that made the database, if it is the one that is planned and left its results in all outputs."""
    entries = read_manifest(plan.task.database)
    if _difference(entries, plan):
        return None
    reason = "the map was made from the same logs, files and settings"
    logs = []
    try:
        options = json.loads(entries["options"])
        excluded = options.get(_EXCLUDED, {})
        for log, (*before, own) in zip(plan.logs, options[_LOGS], strict=True):
            outcomes = zip(log.steps, before, strict=True)
            stages = tuple(StageRun(step.stage.name, "reused", reason, Outcome.of(told)) for step, told in outcomes)
            why = str(excluded.get(log.fingerprint, ""))
            logs.append(MappedLog(log.request.recording, log.fingerprint, stages, Outcome.of(own), why))
        termination = Termination(**options[_SOLVER]) if options[_SOLVER] else None
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
    ):  # damaged: nothing of it can be told again
        return None
    if not all(_is_written(plan, log, parts) for log, one in zip(plan.logs, logs, strict=True) if not one.excluded):
        return None
    build = StageRun(plan.record.stage, "reused", reason, build_outcome(plan, termination))
    return MapRun(read_map(plan.task.database), build, tuple(logs), termination)


def _is_written(plan: MapPlan, log: LogPlan, parts: Path) -> bool:
    """Whether the output of a log, if it has one, holds its results of the map."""
    output = plan.task.outputs.get(log.request.recording)
    if output is None:
        return True
    with open_session(log.request, parts, output) as session:
        return session.find(plan.share(log)) is not None


def build_outcome(plan: MapPlan, termination: Termination | None) -> Outcome:
    """What is to be said of a map beside its landmarks: whether its solver got near its limit."""
    if termination is None or termination.iterations != plan.record.config["max_iterations"]:
        return Outcome()
    limit = f"a solution needed the last of {termination.iterations} iterations"
    return Outcome(notes=(f"{limit}; set a larger build_map.max_iterations",))


def why_anew(plan: MapPlan) -> str:
    """Why the map has to be built, in words, where `earlier_run` found none."""
    if plan.task.requests[0].force:
        return "--force"
    return _difference(read_manifest(plan.task.database), plan) or "an output has no results of it"


def _difference(entries: Mapping[str, str], plan: MapPlan) -> str:
    """What a map that is there, with this manifest, was made from other than is planned; empty if nothing."""
    earlier = stage_records({RUN: entries}).get(plan.record.stage)
    return "there was no such map" if earlier is None else plan.record.difference(earlier)


def write_part(plan: MapPlan, log: LogPlan, landmark_map: LandmarkMap, trajectory: LogTrajectory, parts: Path) -> None:
    """One log's results of the map as a recording of their own."""
    record = plan.share(log)
    with create_recording(part_file(parts, record), is_passing=True) as writer:
        for stamped in _results(landmark_map, trajectory):
            writer.add(stamped, record.stage)
        writer.metadata[RUN] = Manifest("part", fingerprint=record.key, stages=(record,)).entries()


def _results(landmark_map: LandmarkMap, trajectory: LogTrajectory) -> Iterator[Stamped]:
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


def write_log(plan: MapPlan, log: LogPlan, mapped: MappedLog, parts: Path, watch: Watch) -> MappedLog:
    """Write one log with all its results where it has an output; what became of it, with what showed on the way."""
    output, outcome = plan.task.outputs.get(mapped.recording), mapped.outcome
    if output is None:
        return mapped
    with open_session(log.request, parts, output) as session:
        for step in log.steps:
            if session.find(step.record) is None:
                session.work(step, watch)
        if not mapped.excluded:
            session.find(plan.share(log))
        notes, losses = write_output(session, output, VERB, [other.fingerprint for other in plan.logs], watch)
    all_notes, all_losses = told([StageRun(plan.record.stage, "", "", outcome)], notes, losses)
    return replace(mapped, outcome=replace(outcome, notes=all_notes, losses=all_losses))
