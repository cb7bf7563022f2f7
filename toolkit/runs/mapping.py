"""Build one landmark map from many logs, and write each log with its results where asked."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.channels import MAP_MARKERS, MAP_PATH, MAP_POSE, ODOMETRY, SCENE_OBJECTS, TRUTH_OBJECTS
from toolkit.errors import MapError, RecordingError
from toolkit.landmarks.database import write_map
from toolkit.landmarks.markers import markers_from_map
from toolkit.landmarks.model import LandmarkMap, Source
from toolkit.landmarks.observations import LogObservations, Trajectory
from toolkit.landmarks.scene import map_from_scene
from toolkit.manifest import RUN, Manifest
from toolkit.messages.codec import decode
from toolkit.messages.poses import Path as PathMessage
from toolkit.messages.poses import PoseStamped
from toolkit.recording.blocks import Progress
from toolkit.recording.reader import Recording, open_recording
from toolkit.recording.writer import create_recording
from toolkit.runs.bundles import Reading, Span, inputs_of, read_bundles
from toolkit.runs.config import effective
from toolkit.stage import RawMessage, Reduction, Stamped

Watch = Mapping[Path, AbstractContextManager[Progress]]


@dataclass(slots=True)
class LogRun:
    """One log on its way into a map."""

    path: Path
    reading: Reading
    observations: LogObservations
    fingerprint: str


@dataclass(slots=True)
class MapRun:
    """The map and what became of each log."""

    landmark_map: LandmarkMap
    logs: list[LogRun] = field(default_factory=list)
    trajectories: list[Trajectory] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)


def collect_log(stage: Reduction, config: Any, path: Path, span: Span, progress: Progress | None = None) -> LogRun:
    """Observations of one log.

    Raises:
        RecordingError: it has no scene objects or no odometry, or none of its bundles has odometry.
        UsageError: several topics fit.
    """
    reading = Reading()
    with open_recording(path) as recording:
        inputs = inputs_of(recording, stage.reads, (SCENE_OBJECTS, ODOMETRY), span.choice)
        raws = recording.messages(tuple(inputs), span.start_ns, span.end_ns, progress)
        observations = stage.collect(read_bundles(raws, inputs, stage.reads, reading), config)
        reading.close(recording.losses)
        fingerprint = recording.fingerprint()
    if not len(observations.stamps_ns):
        raise RecordingError(
            f"{path}: none of {observations.bundles} bundles has odometry within 2 s; check that the clocks of "
            "odometry and scene objects agree"
        )
    observations = dataclasses.replace(observations, fingerprint=fingerprint)
    return LogRun(path, reading, observations, fingerprint)


def solve_map(stage: Reduction, config: Any, logs: Sequence[LogRun], prior: LandmarkMap | None, target: Path) -> MapRun:
    """Solve, and write the database.

    Raises:
        MapError: what was seen is not enough for a map.
    """
    landmark_map, trajectories = stage.solve([log.observations for log in logs], prior, config)
    write_map(target, landmark_map)
    return MapRun(landmark_map, list(logs), trajectories)


def write_log(
    stage: Reduction,
    config: Any,
    run: MapRun,
    index: int,
    span: Span,
    output: Path,
    *,
    results_only: bool,
) -> None:
    """One log with its trajectory and the map as new channels."""
    log, trajectory = run.logs[index], run.trajectories[index]
    with open_recording(log.path) as recording:
        manifest = Manifest(
            verb="map",
            config={stage.name: effective(config)},
            inputs=tuple(entry.fingerprint for entry in run.logs),
            fingerprint=log.fingerprint,
        )
        writes = {channel.topic for channel in stage.writes}
        kept = [entry.connection for entry in recording.channels if entry.connection.topic not in writes]
        with create_recording(output, {**recording.metadata, RUN: manifest.entries()}) as writer:
            if not results_only:
                for connection in kept:
                    writer.declare(connection)
            raws = iter(()) if results_only else recording.messages(kept, span.start_ns, span.end_ns)
            for item in _by_time(raws, _results(run.landmark_map, trajectory)):
                if isinstance(item, Stamped):
                    writer.add(item, group=stage.name)
                else:
                    writer.write(item)
            for attachment in () if results_only else recording.attachments():
                writer.attach(attachment)


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


def _by_time(raws: Iterator[RawMessage], results: Iterator[Stamped]) -> Iterator[RawMessage | Stamped]:
    """Both streams by log time; at equal times the recording's own messages come first."""
    result = next(results, None)
    for raw in raws:
        while result is not None and result.log_time_ns < raw.log_time_ns:
            yield result
            result = next(results, None)
        yield raw
    while result is not None:
        yield result
        result = next(results, None)


def map_from_reference(path: Path, target: Path) -> LandmarkMap:
    """The surveyed map that a log's `/ground_truth/objects` gives, written as a database.

    Raises:
        MapError: the log has no such message.
    """
    with open_recording(path) as recording:
        raw = _first(recording)
        if raw is None:
            raise MapError(
                f"{path}: there are no {TRUTH_OBJECTS.topic}; build the map from the log without --from-reference"
            )
        scene = decode(TRUTH_OBJECTS.message, raw.data)
        landmark_map = map_from_scene(scene, Source("reference", recording.fingerprint()))
    write_map(target, landmark_map)
    return landmark_map


def _first(recording: Recording) -> RawMessage | None:
    return next(recording.messages(recording.connections(TRUTH_OBJECTS.topic)), None)
