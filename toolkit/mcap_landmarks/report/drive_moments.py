"""A log as it went, moment by moment: the image, scan, pose and status that were known at each."""

import contextlib
import heapq
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from mcap_landmarks.channels import (
    CLUSTERED_CLOUD,
    DETECTIONS,
    MAP_POSE,
    MATCH,
    POSE,
    POSE_COVARIANCE,
    SCENE_OBJECTS,
)
from mcap_landmarks.errors import MessageError
from mcap_landmarks.geometry.frames import FrameTree
from mcap_landmarks.geometry.se2 import Array, between, log
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.header import SHORTEST, stamp_in
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.poses import Odometry, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.scan_points import scan_points
from mcap_landmarks.stage import Connection, RawMessage

_JUMP_NS = 10 * 10**9
"""A stamp that goes otherwise than the log's own clock by more than this is of another clock, and not followed."""
_WAIT_NS = 2 * 10**9
"""Messages wait so long for those with earlier stamps, as in the association of time of a bundle."""
_RECORDED: tuple[type[Message], ...] = (CompressedImage, Image, LaserScan, MultiEchoLaserScan, Odometry)
_OURS = {
    channel.topic: channel.message
    for channel in (DETECTIONS, CLUSTERED_CLOUD, SCENE_OBJECTS, MATCH, POSE, MAP_POSE, POSE_COVARIANCE)
}


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What is known at a time: the last of every kind, points and objects in the base frame with their stamps.

    `odometry` is the last message, and `velocity` (3,) the base's own by the last two. `path` has the stamps and
    positions x, y of the poses so far; it is one list that grows from moment to moment.
    """

    time_ns: int = 0
    image: CompressedImage | Image | None = None
    detections: Detections | None = None
    points_xy: Array = field(default_factory=lambda: np.zeros((0, 2)))
    points_ns: int = 0
    scene: SceneObjects | None = None
    match: LandmarkMatch | None = None
    pose: Array | None = None
    pose_ns: int = 0
    covariance: Array | None = None
    path: list[tuple[int, float, float]] = field(default_factory=list)
    odometry: Odometry | None = None
    velocity: Array | None = None


def readers(connections: Iterable[Connection]) -> dict[Connection, type[Message]]:
    """The connections that moments are made of, with the messages that they are read as."""
    recorded = {message.ROS_TYPE: message for message in _RECORDED}
    found = {one: _OURS.get(one.topic) or recorded.get(one.read_as) for one in connections}
    return {one: message for one, message in found.items() if message is not None and one.read_as == message.ROS_TYPE}


def moments(
    raws: Iterable[RawMessage], read_as: Mapping[Connection, type[Message]], frames: FrameTree, base: str, fps: Fraction
) -> Iterator[Moment]:
    """What was known at every picture of a video with so many a second, from the first message on, in real time.

    Scans are given in the frame `base`, as `frames` lead there. Messages that cannot be read are passed over.
    """
    now, first_ns, number = Moment(), None, 0
    for time_ns, raw in _by_stamp(raws):
        first_ns = time_ns if first_ns is None else first_ns
        while (shown_ns := first_ns + int(number / fps * 10**9)) < time_ns:
            yield replace(now, time_ns=shown_ns)
            number += 1
        with contextlib.suppress(MessageError):
            now = _with(now, decode(read_as[raw.connection], raw.data), frames, base)
    if first_ns is not None:
        yield replace(now, time_ns=first_ns + int(number / fps * 10**9))


def _by_stamp(raws: Iterable[RawMessage]) -> Iterator[tuple[int, RawMessage]]:
    """Messages in the order of their stamps, with the times that these tell."""
    waiting: list[tuple[int, int, RawMessage]] = []
    last_ns = last_log_ns = None
    for number, raw in enumerate(raws):
        stamp_ns = stamp_in(raw.data) if len(raw.data) >= SHORTEST else 0
        if last_ns is None or last_log_ns is None:
            time_ns = stamp_ns or raw.log_time_ns
        else:
            step_ns = raw.log_time_ns - last_log_ns
            followed = stamp_ns and abs(stamp_ns - last_ns - step_ns) <= _JUMP_NS
            time_ns = stamp_ns if followed else last_ns + step_ns
        last_ns, last_log_ns = max(time_ns, last_ns or time_ns), raw.log_time_ns
        heapq.heappush(waiting, (time_ns, number, raw))
        while waiting[0][0] <= last_ns - _WAIT_NS:
            yield _pop(waiting)
    while waiting:
        yield _pop(waiting)


def _pop(waiting: list[tuple[int, int, RawMessage]]) -> tuple[int, RawMessage]:
    time_ns, _, raw = heapq.heappop(waiting)
    return time_ns, raw


def _with(now: Moment, message: Message, frames: FrameTree, base: str) -> Moment:
    """The moment with one more message."""
    changes: dict[str, object] = {}
    match message:
        case CompressedImage() | Image():
            changes = {"image": message}
        case Detections():
            changes = {"detections": message}
        case MultiEchoLaserScan() | LaserScan():
            scan = message.nearest if isinstance(message, MultiEchoLaserScan) else message
            points = scan_points(scan, base, frames, now.velocity)
            changes = {"points_xy": points, "points_ns": scan.stamp_ns}
        case ClusteredCloud():
            changes = {"points_xy": message.points_m[:, :2].astype(np.float64), "points_ns": message.stamp_ns}
        case SceneObjects():
            changes = {"scene": message}
        case LandmarkMatch():
            changes = {"match": message}
        case Odometry():
            changes = {"odometry": message, "velocity": _velocity(now.odometry, message)}
        case PoseStamped():
            changes = _posed(now, message)
        case PoseWithCovarianceStamped():
            changes = {"covariance": message.planar_covariance}
    return replace(now, **changes)  # type: ignore[arg-type] # fields of it


def _velocity(before: Odometry | None, after: Odometry) -> Array | None:
    """The base's own velocity between two messages; None where they are too far apart to tell it."""
    seconds = 0.0 if before is None else (after.stamp_ns - before.stamp_ns) / 1e9
    if before is None or not 0 < seconds <= _WAIT_NS / 1e9:
        return None
    velocity = log(between(before.pose, after.pose)) / seconds
    return velocity if np.isfinite(velocity).all() else None


def _posed(now: Moment, message: PoseStamped) -> dict[str, object]:
    pose = message.pose
    if not message.orientation_xyzw.any():
        pose[2] = np.nan  # a position without heading
    now.path.append((message.stamp_ns, float(pose[0]), float(pose[1])))
    return {"pose": pose, "pose_ns": message.stamp_ns, "covariance": None}
