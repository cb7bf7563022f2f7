"""What is evaluated, from files: recordings with results, landmark databases, Appendix D's text, TUM trajectories."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.channels import MAP, MAP_POSE, MATCH, POSE, POSE_COVARIANCE, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from toolkit.compare import tum
from toolkit.compare.metrics import Outcome, Reference
from toolkit.compare.trajectory import Trajectory
from toolkit.errors import MessageError, RecordingError
from toolkit.geometry.se2 import Array
from toolkit.landmarks.database import read_map
from toolkit.landmarks.exchange import read_text
from toolkit.landmarks.exchange_thesis import parse_results
from toolkit.landmarks.scene import scene_from_map
from toolkit.landmarks.sightings import usable
from toolkit.messages.codec import Message, decode
from toolkit.messages.match import LandmarkMatch, Status
from toolkit.messages.poses import PoseStamped, PoseWithCovarianceStamped
from toolkit.messages.scene import SceneObjects
from toolkit.recording.reader import Recording, open_recording
from toolkit.stage import Channel, Connection

Progress = Callable[[int], None]
_RESULTS = (SCENE_OBJECTS, MATCH, POSE, POSE_COVARIANCE, MAP, MAP_POSE)
_TRUTH = (TRUTH_POSE, TRUTH_OBJECTS)
_ONCE = (MAP, TRUTH_OBJECTS)


def read_run(path: Path, progress: Progress | None = None) -> tuple[Outcome, Reference, list[str]]:
    """What a file holds to evaluate, its own reference, and what of it could not be read.

    The file is a recording with results, a landmark database, or (.txt) results as in the thesis's Appendix D.

    Raises:
        ToolkitError: it is none of these.
    """
    if path.suffix == ".txt":
        return *_appendix_d(path), []
    if is_database(path):
        return Outcome(_trajectory([]), 0, landmarks=scene_from_map(read_map(path), 0)), Reference(), []
    found = _collect(path, (*_RESULTS, *_TRUTH), progress)
    return found.outcome(), found.reference(), found.losses


def read_reference(path: Path, progress: Progress | None = None) -> tuple[Reference, list[str]]:
    """The truth in a file, a TUM trajectory (.tum, .txt) or a recording, and what of it could not be read.

    Raises:
        RecordingError: it is neither, or holds no truth.
    """
    if path.suffix in {".tum", ".txt"}:
        return Reference(tum.parse(read_text(path), str(path))), []
    found = _collect(path, _TRUTH, progress)
    reference = found.reference()
    if reference.trajectory is None and reference.objects is None:
        raise RecordingError(f"{path}: has neither {TRUTH_POSE.topic} nor {TRUTH_OBJECTS.topic}; name a log with truth")
    return reference, found.losses


def _appendix_d(path: Path) -> tuple[Outcome, Reference]:
    results = parse_results(read_text(path), str(path))
    count = len(results.classes)
    unknown = np.full((count, 1), np.nan)  # the thesis estimates no heading
    rows = np.arange(count) * 10**10  # apart in time, since each position stands alone
    eligible = sum(len(classes) >= 2 for classes in results.classes)
    estimate = Trajectory.of(rows, np.hstack([results.estimate_xy, unknown]))
    return Outcome(estimate, count, eligible), Reference(
        Trajectory.of(rows, np.hstack([results.reference_xy, unknown]))
    )


def is_database(path: Path) -> bool:
    """Whether a file is, or by its name should be, a landmark database."""
    try:
        with path.open("rb") as stream:
            return path.suffix == ".db" or stream.read(15) == b"SQLite format 3"
    except OSError:
        return path.suffix == ".db"  # opening it says what is wrong


@dataclass(slots=True)
class _Collected:
    """What of a recording matters to an evaluation."""

    poses: dict[str, list[tuple[int, Array]]] = field(default_factory=dict)
    covariances: dict[int, Array] = field(default_factory=dict)
    seen: dict[int, tuple[str, ...]] = field(default_factory=dict)
    statuses: Counter[Status] = field(default_factory=Counter)
    eligible: int | None = None
    scenes: int = 0
    once: dict[str, SceneObjects] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)

    def add(self, topic: str, time_ns: int, message: Message) -> None:
        if isinstance(message, PoseStamped):
            self.poses.setdefault(topic, []).append((time_ns, message.pose))
        elif isinstance(message, PoseWithCovarianceStamped):
            self.covariances[time_ns] = message.planar_covariance
        elif isinstance(message, LandmarkMatch):
            self.statuses[message.status] += 1
            self.seen[time_ns] = message.landmark_ids
        elif isinstance(message, SceneObjects) and topic == SCENE_OBJECTS.topic:
            self.scenes += 1
            self.eligible = (self.eligible or 0) + (_distinct(message) >= 2)
        elif isinstance(message, SceneObjects):
            self.once.setdefault(topic, message)

    def outcome(self) -> Outcome:
        matches = sum(self.statuses.values())
        continuous = not matches and POSE.topic not in self.poses
        made = self.poses.get((MAP_POSE if continuous else POSE).topic, [])
        statuses = {status.name.lower(): self.statuses[status] for status in Status} if matches else None
        trajectory = _trajectory(made, None if continuous else self.covariances)
        landmarks = self.once.get(MAP.topic)
        return Outcome(trajectory, matches or self.scenes, self.eligible, statuses, landmarks, self.seen, continuous)

    def reference(self) -> Reference:
        truth = self.poses.get(TRUTH_POSE.topic)
        return Reference(_trajectory(truth) if truth else None, self.once.get(TRUTH_OBJECTS.topic))


def _distinct(scene: SceneObjects) -> int:
    """Usable objects that are not the same one: same id, or without ids same class and position."""
    objects = usable(scene, Counter())
    places = [tuple(position) for position in objects.positions_xy.tolist()]
    named = zip(objects.ids, objects.classes, places, strict=True)
    return len({identity or (name, place) for identity, name, place in named})


def _trajectory(poses: list[tuple[int, Array]], covariances: dict[int, Array] | None = None) -> Trajectory:
    unknown = np.full((3, 3), np.nan)
    spread = np.array([(covariances or {}).get(time_ns, unknown) for time_ns, _ in poses]).reshape(-1, 3, 3)
    times = np.array([time_ns for time_ns, _ in poses], dtype=np.int64)
    return Trajectory.of(times, np.array([pose for _, pose in poses]).reshape(-1, 3), spread)


def _collect(path: Path, channels: tuple[Channel[Any], ...], progress: Progress | None) -> _Collected:
    found = _Collected()
    with open_recording(path) as recording:
        connections = _connections(recording, channels)
        for channel, time_ns, message in _decoded(recording, connections, found, progress):
            if isinstance(message, PoseStamped) and not np.isfinite(message.pose).all():
                raise RecordingError(f"{path}: {channel.topic} at {time_ns} is not finite; repair or cut the log")
            found.add(channel.topic, time_ns, message)
        found.losses.extend(recording.losses)
    return found


def _connections(recording: Recording, channels: tuple[Channel[Any], ...]) -> dict[Connection, Channel[Any]]:
    connections = {connection: channel for channel in channels for connection in recording.connections(channel.topic)}
    for connection, channel in connections.items():
        needed = channel.message.ROS_TYPE
        if connection.message_type != needed:
            raise RecordingError(
                f"{recording.path}: {channel.topic} is {connection.message_type} instead of {needed}; "
                "rename that topic, or name the truth with --reference"
            )
    if SCENE_OBJECTS in channels and not recording.connections(SCENE_OBJECTS.topic):
        connections.update(_foreign_scenes(recording))
    return connections


def _foreign_scenes(recording: Recording) -> dict[Connection, Channel[Any]]:
    """The one topic of scene objects that somebody else wrote, if there is one."""
    own = {MAP.topic, TRUTH_OBJECTS.topic, "/landmarks/scan_objects"}
    found = [entry.connection for entry in recording.channels if entry.connection.message_type == SceneObjects.ROS_TYPE]
    foreign = [connection for connection in found if connection.topic not in own]
    return {foreign[0]: SCENE_OBJECTS} if len(foreign) == 1 else {}


def _decoded(
    recording: Recording,
    connections: dict[Connection, Channel[Any]],
    found: _Collected,
    progress: Progress | None,
) -> Iterator[tuple[Channel[Any], int, Message]]:
    """Messages with their header's stamp, or log time where that is zero."""
    broken: Counter[str] = Counter()
    for raw in recording.messages(connections, progress=progress):
        channel = connections[raw.connection]
        if channel in _ONCE and channel.topic in found.once:
            continue
        try:
            message = decode(channel.message, raw.data)
        except MessageError:
            broken[channel.topic] += 1
            continue
        yield channel, getattr(message, "stamp_ns", 0) or raw.log_time_ns, message
    found.losses.extend(f"{topic}: {count} messages could not be decoded" for topic, count in broken.items())
