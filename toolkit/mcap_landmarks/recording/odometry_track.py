"""The robot's odometry over a whole log: where the base was at any time, in pieces that hold together."""

import math
from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import Array, between, interpolate, log
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import OdometryAt, OdometrySamples

WIDEST_GAP_NS = 2 * 10**9
"""The widest gap that odometry is interpolated over: a robot that speeds up by 0.5 m/s^2 in it is misplaced by
a T^2 / 8 = 0.25 m."""

_AROUND_NS = 300_000_000
"""Samples span so much more than the sweep, for a scan of a second LiDAR beside it or a cloud stamped at its end."""
_NOISE = OdometryNoise()
_BASES = ("base_footprint", "base_link")


def odometry_from(message: Message) -> Odometry | None:
    """A message as odometry: itself, a pose as that of the base, or the transform out of a frame called odom."""
    if isinstance(message, Odometry):
        return message
    zero = np.zeros((6, 6))
    if isinstance(message, PoseStamped):
        pose = message.position_m, message.orientation_xyzw
        return Odometry(message.stamp_ns, message.frame_id, "", *pose, zero, np.zeros(3), np.zeros(3), zero)
    if isinstance(message, TFMessage):
        steps = [step for step in message.transforms if "odom" in step.frame_id]
        if steps:
            step = min(steps, key=lambda step: step.child_frame_id.lstrip("/") not in _BASES)
            frames, pose = (step.frame_id, step.child_frame_id), (step.translation_m, step.rotation_xyzw)
            return Odometry(step.stamp_ns, *frames, *pose, zero, np.zeros(3), np.zeros(3), zero)
    return None


@dataclass(frozen=True, slots=True, eq=False)
class OdometryTrack:
    """N poses of the base, `odom_from_base` (N, 3) in `frame_id`, with `covariances` (N, 3, 3).

    `stamps_ns` (N,) rise strictly. `piece` (N,) rises: between two pieces nobody knows how the robot moved. `slack`
    (N, 2) says in m and rad how far the step before may be off beside what odometry always is; it counts as way and
    turning that err as much.
    """

    frame_id: str
    stamps_ns: NDArray[np.int64]
    odom_from_base: Array
    covariances: Array
    piece: NDArray[np.int64]
    slack: Array
    _way_m: Array = field(init=False)
    _turned_rad: Array = field(init=False)
    _velocities: Array = field(init=False)
    _times: list[int] = field(init=False)

    def __post_init__(self) -> None:
        """Add up the way, and the velocities."""
        poses, gaps_ns = self.odom_from_base, np.diff(self.stamps_ns)
        steps = between(poses[:-1], poses[1:])
        steps[np.diff(self.piece) != 0] = 0.0
        way, turned, velocities = [0.0], [0.0], np.zeros((len(poses), 3))
        for (forward, left, turn), (slack_m, slack_rad) in zip(steps.tolist(), self.slack[1:].tolist(), strict=True):
            way.append(way[-1] + math.hypot(forward, left) + (slack_m / _NOISE.position_per_metre_m) ** 2)
            turned.append(turned[-1] + abs(turn) + (slack_rad / _NOISE.heading_per_radian_rad) ** 2)
        near = gaps_ns <= WIDEST_GAP_NS
        velocities[1:][near] = log(steps[near]) / (gaps_ns[near, None] / 1e9)
        for name, value in (("_way_m", np.array(way[: len(poses)])), ("_turned_rad", np.array(turned[: len(poses)]))):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_velocities", velocities)
        object.__setattr__(self, "_times", self.stamps_ns.tolist())

    @classmethod
    def empty(cls) -> "OdometryTrack":
        """No odometry at all."""
        none = np.zeros(0, dtype=np.int64)
        return cls("", none, np.zeros((0, 3)), np.zeros((0, 3, 3)), none, np.zeros((0, 2)))

    def around(self, stamp_ns: int, duration_ns: int) -> OdometrySamples:
        """The messages from a little before a time to a little after a while later, of one piece."""
        left = max(bisect_left(self._times, stamp_ns - _AROUND_NS) - 1, 0)
        right = bisect_left(self._times, stamp_ns + duration_ns + _AROUND_NS) + 1
        rows = np.arange(left, min(right, len(self._times)))
        at = min(bisect_left(self._times, stamp_ns), len(self._times) - 1)
        rows = rows[self.piece[rows] == self.piece[at]]
        return OdometrySamples(self.stamps_ns[rows], self.odom_from_base[rows])

    def at(self, stamp_ns: int) -> OdometryAt | None:
        """Odometry at a time between two stamps of a piece that are close enough together, else None."""
        right = bisect_left(self._times, stamp_ns)
        if right == len(self._times):
            return None
        if self._times[right] == stamp_ns:
            return self._at(right, self.odom_from_base[right], self._way_m[right], self._turned_rad[right], right)
        left = right - 1
        if (
            right == 0
            or self._times[right] - self._times[left] > WIDEST_GAP_NS
            or self.piece[left] != self.piece[right]
        ):
            return None
        rows, share = slice(left, right + 1), (stamp_ns - self._times[left]) / (self._times[right] - self._times[left])
        pose = interpolate(self.stamps_ns[rows], self.odom_from_base[rows], np.array([stamp_ns], dtype=np.int64))[0]
        way_m = self._way_m[left] + share * (self._way_m[right] - self._way_m[left])
        turned_rad = self._turned_rad[left] + share * (self._turned_rad[right] - self._turned_rad[left])
        return self._at(right, pose, way_m, turned_rad, left)

    def _at(self, row: int, pose: Array, way_m: float, turned_rad: float, before: int) -> OdometryAt:
        return OdometryAt(
            self.frame_id,
            pose,
            self.covariances[before],
            float(way_m),
            float(turned_rad),
            self._velocities[row],
            piece=int(self.piece[before]),
        )
