"""The poses of one topic of a recording, whoever wrote it: which topic that is, and its trajectory in the plane."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.channels import MAP_POSE, POSE, POSE_COVARIANCE, TRUTH_POSE
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.evaluation.trajectory import Indices, Trajectory
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.parts import PLANAR
from mcap_landmarks.messages.poses import Odometry, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording, open_recording

WithinNs = tuple[int | None, int | None]
"""Log times to read from, and to stop before; None where there is no such bound."""
_Message = PoseStamped | PoseWithCovarianceStamped | Odometry
_TYPES: dict[str, type[_Message]] = {
    message.ROS_TYPE: message for message in (PoseStamped, PoseWithCovarianceStamped, Odometry)
}
_OURS = (POSE_COVARIANCE.topic, POSE.topic, MAP_POSE.topic, TRUTH_POSE.topic)
"""Our pose channels, the one first that is taken before the others."""
_FLAT_M, _FLAT = 1e-3, 1e-3
"""Less height, and less of a quaternion's x and y, is no more than the noise of a robot on a floor."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """The trajectory of a topic in a frame; the heading of a pose that has none is NaN.

    `others` are the other topics that have poses, `notes` say what was left out, `losses` what could not be read.
    """

    topic: str
    frame: str
    trajectory: Trajectory
    others: tuple[str, ...]
    notes: tuple[str, ...]
    losses: tuple[str, ...]


@dataclass(slots=True)
class _Rows:
    """Poses as they come, in parts of K: log time and time, position, quaternion, planar covariance (NaN: unknown)."""

    log_ns: list[Indices] = field(default_factory=list)
    time_ns: list[Indices] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    quaternions: list[Array] = field(default_factory=list)
    covariances: list[Array] = field(default_factory=list)
    frames: Counter[str] = field(default_factory=Counter)
    broken: int = 0

    def add(self, times: tuple[Indices, Indices], parts: tuple[Array, Array], covariances: Array | None = None) -> None:
        """Take the next poses: log times and stamps (K,), positions (K, 3) and quaternions (K, 4), (K, 3, 3)."""
        log_ns, stamp_ns = times
        self.log_ns.append(log_ns)
        self.time_ns.append(np.where(stamp_ns == 0, log_ns, stamp_ns))
        self.positions.append(parts[0])
        self.quaternions.append(parts[1])
        known = np.full((len(log_ns), 3, 3), np.nan) if covariances is None else covariances.copy()
        known[~known.any(axis=(1, 2))] = np.nan
        self.covariances.append(known)


def read_poses(
    path: Location, topic: str | None = None, child: str | None = None, progress: Progress | None = None
) -> PoseTrack:
    """The poses of a topic, by default of the one that says most of where the robot was.

    That is what localize found, then what map found, then the truth, then odometry, then the poses of others.
    Transforms are read where their topic is named, those to the frame `child`, or to the only one.

    Raises:
        RecordingError: the log cannot be read, or has no poses.
        UsageError: several topics or frames fit, or the named one does not.
    """
    with open_recording(path) as recording:
        return poses_in(recording, topic, child, progress=progress)


def poses_in(
    recording: Recording,
    topic: str | None = None,
    child: str | None = None,
    within_ns: WithinNs = (None, None),
    progress: Progress | None = None,
) -> PoseTrack:
    """The same of an open recording, from a log time on and before another; raises the same."""
    ranks = _candidates(recording)
    chosen = topic or _default(recording.path, ranks)
    if chosen in ranks:
        rows = _read(recording, chosen, within_ns, progress)
    else:
        rows = _transforms(recording, chosen, child, within_ns, progress)
    losses = list(recording.losses)
    if rows.broken:
        losses.insert(0, f"{chosen}: {rows.broken} messages could not be decoded")
    trajectory, notes = _trajectory(rows)
    if not len(trajectory):
        raise RecordingError(f"{recording.path}: {chosen} has no pose that can be used; {'; '.join([*notes, *losses])}")
    others = tuple(other for other in ranks if other != chosen)
    return PoseTrack(chosen, rows.frames.most_common(1)[0][0], trajectory, others, tuple(notes), tuple(losses))


def _candidates(recording: Recording) -> dict[str, int]:
    """The topics with poses, the best first, with their ranks: 0 is the best."""
    counts, kinds = Counter[str](), dict[str, str]()
    for entry in recording.channels:
        if entry.connection.read_as in _TYPES and entry.count:
            counts[entry.connection.topic] += entry.count
            kinds[entry.connection.topic] = entry.connection.message_type
    ours = list(_OURS)
    if counts[POSE.topic] > counts[POSE_COVARIANCE.topic]:  # some positions have neither heading nor covariance
        ours[:2] = reversed(ours[:2])
    of_others = {Odometry.ROS_TYPE: len(ours)}
    ranks = {
        topic: ours.index(topic) if topic in ours else of_others.get(kind, len(ours) + 1)
        for topic, kind in kinds.items()
    }
    return dict(sorted(ranks.items(), key=lambda item: (item[1], item[0])))


def _default(path: Location, ranks: dict[str, int]) -> str:
    best = [topic for topic, rank in ranks.items() if rank == min(ranks.values())]
    if not best:
        raise RecordingError(
            f"{path}: has no poses ({', '.join(_TYPES)}); run localize or map -o on it, or name a topic of transforms "
            "with --topic"
        )
    if len(best) > 1:
        raise UsageError(f"{path}: {' and '.join(best)} have poses; choose with --topic")
    return best[0]


def _read(recording: Recording, topic: str, within_ns: WithinNs, progress: Progress | None) -> _Rows:
    rows = _Rows()
    for connection in recording.connections(topic):
        if connection.read_as not in _TYPES:
            continue
        message = _TYPES[connection.read_as]
        pose = "pose" if message is PoseStamped else "pose.pose"
        fields = ["header.stamp", "header.frame_id", f"{pose}.position", f"{pose}.orientation"]
        fields += [] if message is PoseStamped else ["pose.covariance"]
        layout = layout_of(message.ROS_TYPE, definition(message.ROS_TYPE))
        found = recording.columns(connection, layout, fields, *within_ns, progress)
        stamps, frames, positions, quaternions, *spread = (found.table.columns[name].values for name in fields)
        planar = spread[0].reshape(-1, 6, 6)[:, PLANAR[0], PLANAR[1]] if spread else None
        rows.add((found.log_time_ns, stamps[:, 0]), (positions, quaternions), planar)
        for frame, count in Counter(frames[:, 0].tolist()).items():
            rows.frames[plain(frame.decode(errors="replace"))] += count
        rows.broken += found.broken
    return rows


def _transforms(
    recording: Recording, topic: str, child: str | None, within_ns: WithinNs, progress: Progress | None
) -> _Rows:
    """The transforms of a topic between two frames."""
    wanted = [one for one in recording.connections(topic) if one.read_as == TFMessage.ROS_TYPE]
    if not wanted:
        known = ", ".join([*_TYPES, TFMessage.ROS_TYPE])
        found = ", ".join(one.message_type for one in recording.connections(topic)) or "not in the log"
        raise UsageError(f"{recording.path}: {topic} is {found}; --topic takes {known}")
    moves, broken = dict[tuple[str, str], _Rows](), 0
    for raw in recording.messages(wanted, *within_ns, progress):
        try:
            transforms = decode(TFMessage, raw.data).transforms
        except MessageError:
            broken += 1
            continue
        for one in transforms:
            mine = moves.setdefault((plain(one.frame_id), plain(one.child_frame_id)), _Rows())
            times = np.array([[raw.log_time_ns], [one.stamp_ns]], dtype=np.int64)
            mine.add((times[0], times[1]), (one.translation_m[None], one.rotation_xyzw[None]))
            mine.frames[plain(one.frame_id)] += 1
    rows = _moves_to(child, moves, f"{recording.path}: {topic}")
    rows.broken = broken
    return rows


def _moves_to(child: str | None, moves: Mapping[tuple[str, str], _Rows], place: str) -> _Rows:
    """The transforms to a frame, or the only ones that there are, of those by parent and child."""
    fitting = sorted(pair for pair in moves if child is None or pair[1] == plain(child))
    if len(fitting) != 1:
        several = " and ".join(f"{above} -> {below}" for above, below in fitting or sorted(moves)) or "no transforms"
        raise UsageError(f"{place} has {several}; choose with --child FRAME")
    return moves[fitting[0]]


def _trajectory(rows: _Rows) -> tuple[Trajectory, list[str]]:
    """The trajectory of what can be used, and in words what cannot."""
    nothing = np.zeros(0, dtype=np.int64)
    order = np.argsort(np.concatenate([nothing, *rows.log_ns]), kind="stable")  # of several connections
    times, count = np.concatenate([nothing, *rows.time_ns])[order], len(order)
    positions, quaternions, covariances = (
        np.concatenate([np.zeros((0, *shape)), *found])[order]
        for shape, found in (((3,), rows.positions), ((4,), rows.quaternions), ((3, 3), rows.covariances))
    )
    known = quaternions.any(axis=1)
    headings = np.where(known, yaw_from_quaternion(quaternions), np.nan)
    finite = np.isfinite(positions[:, :2]).all(axis=1) & np.isfinite(quaternions).all(axis=1)
    poses = np.column_stack([positions[:, :2], headings])[finite]
    trajectory = Trajectory.of(times[finite], poses, covariances[finite])
    notes = []
    if lost := count - int(finite.sum()):
        notes.append(f"{lost} poses are not finite; they are left out")
    if twice := int(finite.sum()) - len(trajectory):
        notes.append(f"{twice} poses have the time of another one; the first of each time stays")
    heights = np.abs(np.nan_to_num(positions[:, 2])).max(initial=0.0)
    if heights > _FLAT_M or np.abs(np.nan_to_num(quaternions[:, :2])).max(initial=0.0) > _FLAT:
        notes.append(f"poses are given in the plane: heights (up to {heights:.3g} m) and tilts are left out")
    if len(rows.frames) > 1:
        notes.append(f"the poses are in several frames: {', '.join(sorted(rows.frames))}")
    return trajectory, notes
