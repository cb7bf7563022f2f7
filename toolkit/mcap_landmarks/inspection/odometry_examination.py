"""Odometry examined before it is used: what its messages say, and what of that can be believed."""

from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.estimation.odometry_pieces import NO_PIECE, find_pieces
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.geometry.frames import plain, planar
from mcap_landmarks.geometry.se2 import Array, between, compose, inverse
from mcap_landmarks.inspection.log_frames import is_robot
from mcap_landmarks.inspection.odometry_use import ALWAYS, CHOOSE, Use, added_up, usable_messages
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.moments import LATEST_NS
from mcap_landmarks.recording.clocks import Clock, Times
from mcap_landmarks.recording.odometry_track import OdometryTrack

_NUMBERS = 22
"""Of each message: position, quaternion, covariance of x, y and heading, linear and angular velocity."""
_TWICE = "odometry messages that repeat the time of another"
_LOST_NS = 200_000_000
"""After a longer while without odometry that can be believed it counts as begun anew."""
_FASTEST_MPS = 70.0
"""Odometry that usually is faster is not in metres."""
_LYING = 0.5
"""The cosine between up and the z axis of the odometry's frame, below which that frame does not lie flat."""

STRAY = "whose stamp cannot be: it is zero, or far before or after the others'"

BaseFromFrame = Callable[[str], Array]
"""The transform (4, 4) from a frame to the base's; raises RecordingError where nothing leads there."""


@dataclass(slots=True)
class OdometryMessages:
    """What a topic's odometry messages say, gathered one by one."""

    log_ns: "array[int]" = field(default_factory=lambda: array("q"))
    stamp_ns: "array[int]" = field(default_factory=lambda: array("q"))
    frames: list[tuple[str, str]] = field(default_factory=list)
    numbers: "array[float]" = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        return len(self.log_ns)

    @property
    def times(self) -> tuple[Times, Times]:
        """Log times and stamps (N,)."""
        return np.array(self.log_ns, dtype=np.int64), np.array(self.stamp_ns, dtype=np.int64)

    def take(self, log_time_ns: int, message: Odometry) -> None:
        """One more message, by log time."""
        self.log_ns.append(min(log_time_ns, LATEST_NS))
        self.stamp_ns.append(message.stamp_ns)
        self.frames.append((plain(message.frame_id), plain(message.child_frame_id)))
        for values in (
            message.position_m,
            message.orientation_xyzw,
            message.planar_covariance.ravel(),
            message.linear_mps,
            message.angular_radps,
        ):
            self.numbers.extend(values.tolist())


@dataclass(frozen=True, slots=True, eq=False)
class ExaminedOdometry:
    """Odometry that can be used, None where it cannot and `refusal` says why and what to do.

    `dropped` counts the messages that were left out, by reason; `notes` say what was made of the others. `delay_ns` is
    how much later than stamped messages are logged, None where their clock was set back.
    """

    track: OdometryTrack | None
    refusal: str = ""
    dropped: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()
    delay_ns: int | None = None


def examine(topic: str, messages: OdometryMessages, clock: Clock, base_from: BaseFromFrame) -> ExaminedOdometry:
    """What of a topic's messages can be used as the odometry of the base.

    Left out are messages with stray stamps, or times that go back, numbers that are not finite, no orientation, or a
    covariance that says that the robot is lost. Where all poses stay the same or have no orientation the twists are
    added up. Poses of another frame than the base's become its own, and are laid flat. What leaps is cut into pieces.
    """
    dropped, told = Counter[str](), _Told()
    try:
        rows = _own(topic, messages)
        times_ns, rows = _in_time(messages, rows, clock, dropped)
        values = np.array(messages.numbers).reshape(-1, _NUMBERS)[rows]
        use = usable_messages(topic, values, times_ns, dropped)
        segment = _segments(times_ns - clock.offset_ns, np.array(messages.stamp_ns, dtype=np.int64)[rows], clock)
        segment = (segment + np.cumsum(_resumed(times_ns, use)))[use.usable]
        times_ns, rows, values = times_ns[use.usable], rows[use.usable], values[use.usable]
        if not len(rows):
            return ExaminedOdometry(None, dropped=+dropped)
        frame, child = messages.frames[rows[0]]
        if use.by_twist:
            told.mended.append(f"the poses of {topic} {use.by_twist}; its velocities are added up instead")
            poses = _of_base(added_up(times_ns, values), base_from(child))
        else:
            poses = _flat(topic, values, base_from(child), told)
        track = _track(topic, (times_ns, segment), poses, values, dropped, told)
    except RecordingError as error:
        return ExaminedOdometry(None, str(error), +dropped)
    # What was mended is not where the log's own frame has it.
    named = track if told.mended else replace(track, frame_id=frame)
    delay_ns = clock.delay_ns if len(clock.shifts_ns) == 1 else None
    return ExaminedOdometry(named, "", +dropped, (*told.mended, *told.notes), delay_ns)


@dataclass(frozen=True, slots=True)
class _Told:
    """What is to be said: that poses are not those of the messages any more, and what else."""

    mended: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def _own(topic: str, messages: OdometryMessages) -> NDArray[np.int64]:
    """The rows of the messages that are of the robot, where a few or many are of another frame.

    Raises:
        RecordingError: several frames could be the robot's.
    """
    counts = Counter(child for _, child in messages.frames)
    known = [child for child, count in counts.items() if count >= (1 - ALWAYS) / 2 * len(messages)]
    bases = [child for child in known if is_robot(child)]
    if len(known) > 1 and len(bases) != 1:
        names = ", ".join(sorted(known))
        raise RecordingError(f"{topic} has odometry of several frames, {names}: these are several robots; {CHOOSE}")
    own = (bases or known)[0]
    return np.array([i for i, (_, child) in enumerate(messages.frames) if child == own], dtype=np.int64)


def _in_time(
    messages: OdometryMessages, rows: NDArray[np.int64], clock: Clock, dropped: Counter[str]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Times and rows of the messages whose stamps can be, and rise."""
    times, kept, latest_ns = list[int](), list[int](), -(2**63)
    dropped["odometry messages of another frame than the others"] += len(messages) - len(rows)
    for row in rows.tolist():
        log_ns = messages.log_ns[row]
        moment_ns = clock.moment(log_ns, messages.stamp_ns[row])
        if moment_ns is None:
            dropped[f"odometry messages {STRAY}"] += 1
            continue
        if moment_ns <= latest_ns:
            twice = moment_ns == latest_ns
            dropped[_TWICE if twice else "odometry messages whose time goes backwards"] += 1
            continue
        times.append(latest_ns := moment_ns)
        kept.append(row)
    return np.array(times, dtype=np.int64), np.array(kept, dtype=np.int64)


def _of_base(odom_from_child: Array, base_from_child: Array) -> Array:
    """Poses (N, 3) of the base from those of a frame on it, in the plane; they begin at zero."""
    child_from_base = inverse(planar(base_from_child))
    return between(compose(odom_from_child[0], child_from_base), compose(odom_from_child, child_from_base))


def _flat(topic: str, values: Array, base_from_child: Array, told: _Told) -> Array:
    """Poses (N, 3) of the base, seen along what is up for it on the mean."""
    odom_from_child = Rotation.from_quat(values[:, 3:7])
    odom_from_base = odom_from_child * Rotation.from_matrix(base_from_child[:3, :3].T)
    up = odom_from_base.apply([0.0, 0.0, 1.0]).mean(axis=0)
    if np.array_equal(base_from_child, np.eye(4)) and up[2] > _LYING:
        return np.column_stack([values[:, :2], yaw_from_quaternion(values[:, 3:7])])
    places = values[:, :3] + odom_from_base.apply(-base_from_child[:3, 3])
    if up[2] <= _LYING:
        upright, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])
        places, odom_from_base = upright.apply(places), upright * odom_from_base
        told.mended.append(
            f"the frame of {topic} does not lie flat; what is up for the robot on the mean is taken for up"
        )
    return np.column_stack([places[:, :2], yaw_from_quaternion(odom_from_base.as_quat())])


def _segments(times_ns: Times, stamp_ns: Times, clock: Clock) -> Times:
    """Which setting of its clock each message (N,) is of."""
    if len(clock.shifts_ns) == 1:
        return np.zeros(len(times_ns), dtype=np.int64)
    return np.cumsum(np.diff(times_ns - stamp_ns, prepend=times_ns[:1] - stamp_ns[:1]) != 0)


def _resumed(times_ns: Times, use: Use) -> NDArray[np.bool_]:
    """Which messages (N,) are the first after a while in which the robot was lost."""
    found = np.zeros(len(times_ns), dtype=np.bool_)
    kept = np.flatnonzero(use.usable)
    gone = np.concatenate([[0], np.cumsum(use.lost)])
    since = (gone[kept[1:]] > gone[kept[:-1]]) & (np.diff(times_ns[kept]) > _LOST_NS)
    found[kept[1:][since]] = True
    return found


def _track(
    topic: str,
    times: tuple[Times, Times],
    poses: Array,
    values: Array,
    dropped: Counter[str],
    told: _Told,
) -> OdometryTrack:
    """The track of poses (N, 3) at `times`, of which each has its segment, too.

    Raises:
        RecordingError: they are not in metres, of several robots, or hardly any two of them go together.
    """
    times_ns, segment = times
    times_s = (times_ns - times_ns[0]) / 1e9
    found = find_pieces(times_s, poses, segment)
    if found.places:
        places = " and at ".join(f"({x:.1f}, {y:.1f}) m" for x, y in found.places[:2])
        raise RecordingError(f"{topic}: several robots publish odometry on it, at {places}, by turns; {CHOOSE}")
    if (speed := _speed(times_s, poses)) > _FASTEST_MPS:
        raise RecordingError(f"{topic}: odometry mostly moves at {speed:.0f} m/s, as if it were in mm; {CHOOSE}")
    if (gone := int((found.piece == NO_PIECE).sum())) > len(poses) / 2:
        raise RecordingError(f"{topic}: {gone} of {len(poses)} odometry messages leap away from the others; {CHOOSE}")
    dropped.update(found.dropped)
    if found.bridged:
        leaps = "leap of odometry is" if found.bridged == 1 else "leaps of odometry are"
        told.mended.append(
            f"{found.bridged} {leaps} taken out of {topic}: the robot is taken to have driven on as before"
        )
    if (count := int(found.piece.max(initial=0)) + 1) > 1:
        leaps = f"odometry on {topic} leaps, was reset or had its clock set back"
        told.notes.append(f"{leaps}: it is cut into {count} pieces that nothing but landmarks joins")
    kept = found.piece != NO_PIECE
    covariances = np.zeros((int(kept.sum()), 3, 3))
    covariances[:] = values[kept, 7:16].reshape(-1, 3, 3)
    return OdometryTrack("", times_ns[kept], found.poses[kept], covariances, found.piece[kept], found.slack[kept])


def _speed(times_s: Array, poses: Array) -> float:
    """The median speed in m/s of poses (N, 3) as they are: where all steps are too long, all are leaps."""
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T) / np.maximum(np.diff(times_s), 1e-6)
    return float(np.median(steps)) if len(steps) else 0.0
