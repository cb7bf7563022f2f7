"""What odometry and sensors saw of the robot's turning, in a few stretches of a log."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError
from mcap_landmarks.estimation.clock_offset import Headings, Turns
from mcap_landmarks.estimation.object_rotation import object_turn
from mcap_landmarks.geometry.se2 import Array, between, compose
from mcap_landmarks.inspection.sensor_mounts import Mount
from mcap_landmarks.lidar.scan_repair import ScanTopic
from mcap_landmarks.lidar.scan_rotation import turn_between
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.odometry_track import OdometryTrack
from mcap_landmarks.stage import Connection, RawMessage

Read = Callable[[Collection[Connection], int, int], Iterable[RawMessage]]
"""Messages of connections by log time, from a time on and before another."""

_STRETCH_NS = 8 * 10**9
_MOST_STRETCHES = 20
"""Of so many stretches, spread over the log, those are chosen that sensors are looked at in."""
_TURNING, _QUIET = 5, 2
"""In so many of them the sensors are, where odometry turns most and where it turns least: some 600 scans at 10 Hz."""
_STEP_NS = 90_000_000
"""Messages that come faster are thinned to 10 Hz: enough for the turns of robots."""
_LONGEST_STEP_NS = 1_200_000_000
"""Scans farther apart share too little to be matched."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledOdometry:
    """Odometry: stamps (N,) that rise strictly, poses (N, 3) whose headings add up.

    `delay_ns` is how much later than they were messages are logged, on the median.
    """

    stamps_ns: NDArray[np.int64]
    poses: Array
    delay_ns: float = 0.0

    @property
    def headings(self) -> Headings:
        """Its headings alone."""
        return Headings(self.stamps_ns, self.poses[:, 2])

    def moved(self, start_ns: int, end_ns: int, mounted: Array) -> Array:
        """How far (2,) a sensor at `mounted` (3,) on the base went between two times, in its frame at the first."""
        times = [start_ns, end_ns]
        first, last = np.stack([np.interp(times, self.stamps_ns, self.poses[:, i]) for i in range(3)], axis=1)
        moved: Array = between(compose(first, mounted), compose(last, mounted))[:2]
        return moved


def stretches(start_ns: int, end_ns: int) -> list[tuple[int, int]]:
    """First and last log time of stretches that are spread evenly over a log; they cover a short one."""
    count = max(-(-(end_ns - start_ns) // _STRETCH_NS), 1)
    places = np.unique(np.linspace(0, count - 1, min(count, _MOST_STRETCHES)).round().astype(int))
    return [(start_ns + int(i) * _STRETCH_NS, start_ns + (int(i) + 1) * _STRETCH_NS) for i in places]


def sampled(track: OdometryTrack, delay_ns: float) -> SampledOdometry:
    """Odometry as it was examined, with headings that add up; it is logged so much later than stamped."""
    poses = track.odom_from_base.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    return SampledOdometry(track.stamps_ns, poses, delay_ns)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else 0.0


def most_and_least_turning(track: SampledOdometry, spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The stretches, by log times, where odometry's rate changes most and where it turns least, in the log's order."""
    changes, turns = [], []
    log_ns = track.stamps_ns + round(track.delay_ns)
    for start_ns, end_ns in spans:
        inside = (log_ns >= start_ns) & (log_ns < end_ns)
        stamps, headings = track.stamps_ns[inside], track.poses[inside, 2]
        if len(stamps) < 3:
            changes.append(0.0)
            turns.append(0.0)
            continue
        grid = np.arange(stamps[0], stamps[-1], 4 * _STEP_NS)
        steps = np.diff(np.interp(grid, stamps, headings))
        changes.append(float(np.abs(np.diff(steps)).sum()))
        turns.append(float(np.abs(steps).sum()))
    by_change = sorted(range(len(spans)), key=lambda i: -changes[i])
    chosen = by_change[:_TURNING]
    rest = sorted(by_change[_TURNING:], key=lambda i: turns[i])
    return [spans[i] for i in sorted([*chosen, *rest[:_QUIET]])]


@dataclass(frozen=True, slots=True, eq=False)
class SensorTurns:
    """What a sensor saw: turns, how much later than they were messages are logged, and the sigma of a bearing.

    The sigma is zero where objects do not tell one.
    """

    turns: Turns
    delay_ns: float
    bearing_rad: float


def read_turns(
    read: Read, sensor: Connection, spans: Sequence[tuple[int, int]], track: SampledOdometry, mount: Mount
) -> SensorTurns:
    """How far a sensor saw the robot turn from each of its messages to the next, in some stretches."""
    rows: list[tuple[int, int, float]] = []
    delays: list[int] = []
    sigmas: list[float] = []
    for start_ns, end_ns in spans:
        before: LaserScan | SceneObjects | None = None
        for log_ns, now in _messages(read([sensor], start_ns, end_ns)):
            step_ns = now.stamp_ns - before.stamp_ns if before is not None else 0
            if 0 < step_ns < _STEP_NS:
                continue
            delays.append(_delay_ns(log_ns, now))
            sigmas += _bearing_sigmas(now) if isinstance(now, SceneObjects) else []
            if before is not None and 0 < step_ns <= _LONGEST_STEP_NS:
                rows += _turns(before, now, track, mount.base_from_sensor)
            before = now
    starts, ends = (np.array([row[i] for row in rows], dtype=np.int64) for i in range(2))
    turned = mount.upright * np.array([row[2] for row in rows], dtype=np.float64)
    return SensorTurns(Turns(starts, ends, turned), _median(delays), _median(sigmas))


def _delay_ns(log_ns: int, message: LaserScan | SceneObjects) -> int:
    """How much later a message is logged; whether a scan's stamp is that of its first or last beam is not told."""
    delay_ns = log_ns - message.stamp_ns
    sweep_ns = message.duration_ns if isinstance(message, LaserScan) else 0
    return min(delay_ns, delay_ns - sweep_ns, key=abs)


def _bearing_sigmas(scene: SceneObjects) -> list[float]:
    """The sigmas of the bearings of objects, as their covariances say; none where these say nothing."""
    x, y = scene.positions_xy.T
    across = np.stack([-y, x], axis=1)
    square = np.einsum("ni,nij,nj->n", across, scene.covariances, across)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigmas = np.sqrt(square) / (x * x + y * y)
    return [sigma for sigma in sigmas.tolist() if 0 < sigma < 1]


def _messages(raws: Iterable[RawMessage]) -> Iterator[tuple[int, LaserScan | SceneObjects]]:
    """Log times and messages with stamps: log times where those are zero."""
    topic = ScanTopic()
    for raw in raws:
        message: LaserScan | SceneObjects
        try:
            if raw.connection.message_type == LaserScan.ROS_TYPE:
                message, _ = topic.take(decode(LaserScan, raw.data))
            else:
                message = decode(SceneObjects, raw.data)
        except MessageError:
            continue
        yield raw.log_time_ns, message if message.stamp_ns else replace(message, stamp_ns=raw.log_time_ns)


def _turns(
    first: LaserScan | SceneObjects, second: LaserScan | SceneObjects, track: SampledOdometry, mounted: Array
) -> list[tuple[int, int, float]]:
    """From when to when the robot turned how far between two messages; nothing where they do not tell."""
    if isinstance(first, LaserScan) and isinstance(second, LaserScan):
        seconds = (second.stamp_ns - first.stamp_ns) * 1e-9
        angles = first.angle_min_rad + np.arange(len(first.ranges_m), dtype=np.float64) * first.angle_increment_rad
        moved = track.moved(first.stamp_ns, second.stamp_ns, mounted)
        found = turn_between(_ranges(first), _ranges(second), angles, moved, seconds)
        if found is None:
            return []
        start_ns = first.stamp_ns + round(found.first * first.duration_ns)
        return [(start_ns, second.stamp_ns + round(found.second * second.duration_ns), found.turned_rad)]
    if isinstance(first, SceneObjects) and isinstance(second, SceneObjects):
        same = np.array([[one == other for other in second.classes] for one in first.classes], dtype=np.bool_)
        moved = track.moved(first.stamp_ns, second.stamp_ns, mounted)
        turned = object_turn(first.positions_xy, second.positions_xy, same.reshape(len(first), len(second)), moved)
        return [] if turned is None else [(first.stamp_ns, second.stamp_ns, turned)]
    return []


def _ranges(scan: LaserScan) -> Array:
    """Ranges (N,) as they are measured, not finite where nothing came back."""
    ranges = scan.ranges_m.astype(np.float64)
    with np.errstate(invalid="ignore"):
        inside = (ranges >= scan.range_min_m) & ((ranges < scan.range_max_m) | (scan.range_max_m <= scan.range_min_m))
    return np.where(inside, ranges, np.inf)
