"""What of a recording matters to an evaluation, gathered from columns of many messages at a time."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import MAP, MAP_MARKERS, MAP_POSE, POSE, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.evaluation.metrics import Reference, RunResult
from mcap_landmarks.evaluation.trajectory import Indices, Trajectory
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.map_markers import landmarks_from_markers
from mcap_landmarks.maps.scene_objects import usable
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.columns import Table
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.parts import PLANAR
from mcap_landmarks.messages.poses import PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import definition_in
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.clocks import Clock
from mcap_landmarks.stage import Channel

Flags = NDArray[np.bool_]
_APART_M = 0.5
"""Objects farther apart than this are two, whatever their ids and classes; nearer ones need a closer look."""
ONCE = (MAP, MAP_MARKERS, TRUTH_OBJECTS)
"""Channels of which the first message counts."""
COLUMNAR = (PoseStamped, PoseWithCovarianceStamped, LandmarkMatch)
"""Messages without lists of messages: their columns can be gathered without a loop over them."""


@dataclass(slots=True)
class Collected:
    """What is found in the recording `name`: poses and covariances in parts of N messages, matches, scenes, losses.

    `clock` tells where the log's clock was set back.
    """

    name: str
    poses: dict[str, list[tuple[Indices, Array]]] = field(default_factory=dict)
    covariances: list[tuple[Indices, Array]] = field(default_factory=list)
    seen: dict[int, tuple[str, ...]] = field(default_factory=dict)
    statuses: Counter[Status] = field(default_factory=Counter)
    residuals: list[Array] = field(default_factory=list)
    eligible: int | None = None
    scenes: int = 0
    once: dict[str, SceneObjects] = field(default_factory=dict)
    broken: Counter[str] = field(default_factory=Counter)
    losses: list[str] = field(default_factory=list)
    clock: Clock = field(default_factory=Clock)

    def add(self, channel: Channel[Message], schema: str, logged_ns: Sequence[int], messages: Sequence[bytes]) -> None:
        """Take messages of a channel, in the order of their log times; those that cannot be decoded are counted.

        `schema` is how the log defines their type: it may be of an earlier version.

        Raises:
            RecordingError: a pose is not finite.
        """
        ros_type = channel.message.ROS_TYPE
        try:
            table = layout_of(ros_type, definition_in(ros_type, schema)).table(messages)
        except MessageError:
            half = len(messages) // 2
            if not half:
                self.broken[channel.topic] += 1
                return
            self.add(channel, schema, logged_ns[:half], messages[:half])
            self.add(channel, schema, logged_ns[half:], messages[half:])
            return
        if channel in ONCE:
            self._once(channel, messages[0])
        elif channel.message in COLUMNAR:
            self.add_table(channel, np.array(logged_ns, dtype=np.int64), table)
        else:
            self._scenes(table, messages)

    def add_table(self, channel: Channel[Message], logged_ns: Indices, table: Table, broken: int = 0) -> None:
        """Take messages of a type in COLUMNAR by their columns, logged at times (N,); others were `broken`.

        Raises:
            RecordingError: a pose is not finite.
        """
        if broken:
            self.broken[channel.topic] += broken
        stamps = table.columns["header.stamp"].values[:, 0]
        times = np.where(stamps == 0, logged_ns, stamps)
        if len(self.clock.shifts_ns) > 1:  # each moment of the log has a time of its own
            pairs = zip(logged_ns.tolist(), times.tolist(), strict=True)
            times = times + np.array([self.clock.shift_ns(*pair) for pair in pairs], dtype=np.int64)
        if channel.message is PoseStamped:
            self._poses(channel.topic, times, table)
        elif channel.message is PoseWithCovarianceStamped:
            full = table.columns["pose.covariance"].values.reshape(-1, 6, 6)
            self.covariances.append((times, full[:, PLANAR[0], PLANAR[1]]))
        else:
            self._matches(channel.topic, times, table)

    def result(self) -> RunResult:
        """What the run gave."""
        matches = self.statuses.total()
        continuous = not matches and POSE.topic not in self.poses
        made = self.poses.get((MAP_POSE if continuous else POSE).topic, [])
        statuses = {status.name.lower(): self.statuses[status] for status in Status} if matches else None
        trajectory = _trajectory(made, [] if continuous else self.covariances)
        landmarks, drawn = self.once.get(MAP.topic), self.once.get(MAP_MARKERS.topic)
        bundles = matches or self.scenes
        residuals = np.concatenate([np.zeros(0), *self.residuals])
        return RunResult(
            trajectory, bundles, self.eligible, statuses, landmarks, self.seen, continuous, drawn, residuals
        )

    def reference(self) -> Reference:
        """The truth that the recording holds."""
        truth = self.poses.get(TRUTH_POSE.topic)
        return Reference(_trajectory(truth, []) if truth else None, self.once.get(TRUTH_OBJECTS.topic))

    def _once(self, channel: Channel[Message], data: bytes) -> None:
        try:
            message = decode(channel.message, data)
        except MessageError:  # such as markers of another kind than ours
            self.broken[channel.topic] += 1
            return
        scene = landmarks_from_markers(message) if isinstance(message, MarkerArray) else message
        if isinstance(scene, SceneObjects):
            self.once.setdefault(channel.topic, scene)

    def _poses(self, topic: str, times: Indices, table: Table) -> None:
        position, orientation = (table.columns[f"pose.{part}"].values for part in ("position", "orientation"))
        poses = np.column_stack([position[:, :2], yaw_from_quaternion(orientation)])
        bad = ~np.isfinite(poses).all(axis=1)
        if bad.any():
            raise RecordingError(
                f"{self.name}: {topic} at {moment(int(times[bad][0]))} is not finite; repair or cut the log"
            )
        if topic == POSE.topic:
            poses[~orientation.any(axis=1), 2] = np.nan  # a position without heading
        self.poses.setdefault(topic, []).append((times, poses))

    def _matches(self, topic: str, times: Indices, table: Table) -> None:
        known = {status.value: status for status in Status}
        ids, start = table.columns["landmark_ids"], 0
        counts = np.zeros(len(times), dtype=np.int64) if ids.counts is None else ids.counts
        self.residuals.append(table.columns["residual_m"].values[:, 0])
        names = [name.decode(errors="replace") for name in ids.values[:, 0].tolist()]
        numbers = table.columns["status"].values[:, 0].tolist()
        for time_ns, number, count in zip(times.tolist(), numbers, counts.tolist(), strict=True):
            if number in known:
                self.statuses[known[number]] += 1
                self.seen[time_ns] = tuple(names[start : start + count])
            else:
                self.broken[topic] += 1
            start += count

    def _scenes(self, table: Table, messages: Sequence[bytes]) -> None:
        self.scenes += table.rows
        certain, doubtful = _two_distinct(*table.children["detections"])
        doubts = sum(_distinct(decode(SceneObjects, messages[row])) >= 2 for row in np.flatnonzero(doubtful).tolist())
        self.eligible = (self.eligible or 0) + int(certain.sum()) + doubts


def _two_distinct(counts: Indices, objects: Table) -> tuple[Flags, Flags]:
    """Which scenes surely have two distinct objects, and which need a closer look; of all others none has.

    Sure is a scene whose first two objects are beyond doubt: known to be usable, and apart.
    """
    several = np.flatnonzero(counts >= 2)
    one = (np.cumsum(counts) - counts)[several]
    results, found = objects.children["results"]
    first = np.cumsum(results) - results
    position, spread = found.columns["pose.pose.position"].values, found.columns["pose.covariance"].values
    sure = (results[one] > 0) & (results[one + 1] > 0)
    one = one[sure]
    left, right = position[first[one], :2], position[first[one + 1], :2]
    with np.errstate(invalid="ignore", over="ignore"):
        good = np.linalg.norm(left - right, axis=1) > _APART_M  # false where a number is none
        good &= _plain(spread[first[one]]) & _plain(spread[first[one + 1]])
    ids = objects.columns["id"].values[:, 0]
    good &= (ids[one] != ids[one + 1]) | (ids[one] == b"")
    certain, doubtful = np.zeros((2, len(counts)), dtype=np.bool_)
    certain[several[sure][good]] = True
    doubtful[several] = ~certain[several]
    return certain, doubtful


def _plain(spread: Array) -> Flags:
    """Which covariances (N, 36) are finite in the plane and surely positive definite or unknown."""
    a, b, also_b, c = (spread[:, column] for column in (0, 1, 6, 7))
    unknown = (a == 0) & (b == 0) & (also_b == 0) & (c == 0)
    symmetric = np.abs(b - also_b) <= 1e-6 * (np.abs(a) + np.abs(c))  # as `usable` has it
    found: Flags = unknown | ((a > 0) & (c > 0) & symmetric & (a * c - b * b > 0) & np.isfinite(a + c))
    return found


def _distinct(scene: SceneObjects) -> int:
    """Usable objects that are not the same one: same id, or without ids same class and position."""
    objects = usable(scene, Counter())
    places = [tuple(position) for position in objects.positions_xy.tolist()]
    named = zip(objects.ids, objects.classes, places, strict=True)
    return len({identity or (name, place) for identity, name, place in named})


def _trajectory(poses: list[tuple[Indices, Array]], spreads: list[tuple[Indices, Array]]) -> Trajectory:
    times, found = _joined(poses, (3,))
    covariances = np.full((len(times), 3, 3), np.nan)
    if spreads:
        known_ns, known = _joined(spreads, (3, 3))
        stamps, last = np.unique(known_ns[::-1], return_index=True)  # of several of one time the last counts
        place = np.clip(np.searchsorted(stamps, times), 0, len(stamps) - 1)
        has = stamps[place] == times
        covariances[has] = known[::-1][last][place[has]]
    return Trajectory.of(times, found, covariances)


def _joined(parts: list[tuple[Indices, Array]], shape: tuple[int, ...]) -> tuple[Indices, Array]:
    times = [time_ns for time_ns, _ in parts]
    return np.concatenate([np.zeros(0, dtype=np.int64), *times]), np.concatenate(
        [np.zeros((0, *shape)), *(values for _, values in parts)]
    )
