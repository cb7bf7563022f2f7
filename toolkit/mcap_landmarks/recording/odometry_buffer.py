"""The robot's odometry of the last seconds, whatever message carried it."""

import math
from bisect import bisect_left
from collections import deque
from itertools import islice

import numpy as np

from mcap_landmarks.geometry.se2 import between, interpolate, log
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import OdometryAt, OdometrySamples

WIDEST_GAP_NS = 2 * 10**9
"""The widest gap that odometry is interpolated over: a robot that speeds up by 0.5 m/s^2 in it is misplaced by
a T^2 / 8 = 0.25 m."""

_KEPT_NS = 3 * WIDEST_GAP_NS
"""A bundle waits for one such time, its sweep may take another, and a gap before it a third."""
_AROUND_NS = 300_000_000
"""Samples span so much more than the sweep, for a scan of a second LiDAR beside it or a cloud stamped at its end."""
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


class OdometryBuffer:
    """The last seconds of odometry, by stamp. `out_of_order` and `not_finite` count the messages that were no use."""

    def __init__(self) -> None:
        self.out_of_order = self.not_finite = 0
        self._stamps: deque[int] = deque()
        self._steps: deque[OdometryAt] = deque()

    @property
    def latest_ns(self) -> int:
        """The stamp of the last message, long ago if there is none."""
        return self._stamps[-1] if self._stamps else -(2**63)

    def add(self, stamp_ns: int, message: Odometry) -> None:
        """Take one more message; later ones only count if their stamp is later too."""
        pose = message.pose
        if not np.isfinite(pose).all():
            self.not_finite += 1
            return
        if stamp_ns <= self.latest_ns:
            self.out_of_order += 1
            return
        way_m, turned_rad, velocity = 0.0, 0.0, np.zeros(3)
        if self._steps:
            last, gap_ns = self._steps[-1], stamp_ns - self.latest_ns
            step = between(last.odom_from_base, pose)
            forward, left, turn = step.tolist()
            way_m, turned_rad = last.way_m + math.hypot(forward, left), last.turned_rad + abs(turn)
            if gap_ns <= WIDEST_GAP_NS:
                velocity = log(step) / (gap_ns / 1e9)
        self._stamps.append(stamp_ns)
        at = OdometryAt(message.frame_id, pose, message.planar_covariance, way_m, turned_rad, velocity)
        self._steps.append(at)
        while self._stamps[0] < stamp_ns - _KEPT_NS and len(self._stamps) > 2:
            self._stamps.popleft()
            self._steps.popleft()

    def around(self, stamp_ns: int, duration_ns: int) -> OdometrySamples:
        """The messages from a little before a time to a little after a while later."""
        left = max(bisect_left(self._stamps, stamp_ns - _AROUND_NS) - 1, 0)
        right = bisect_left(self._stamps, stamp_ns + duration_ns + _AROUND_NS) + 1
        steps = list(islice(self._steps, left, right))
        stamps = np.array(list(islice(self._stamps, left, right)), dtype=np.int64)
        return OdometrySamples(stamps, np.array([step.odom_from_base for step in steps]).reshape(-1, 3))

    def at(self, stamp_ns: int) -> OdometryAt | None:
        """Odometry at a time between two stamps that are close enough together, else None."""
        right = bisect_left(self._stamps, stamp_ns)
        if right == len(self._stamps):
            return None
        after = self._steps[right]
        if self._stamps[right] == stamp_ns:
            return after
        if right == 0 or self._stamps[right] - self._stamps[right - 1] > WIDEST_GAP_NS:
            return None
        before, times = self._steps[right - 1], np.array([self._stamps[right - 1], self._stamps[right]], dtype=np.int64)
        poses = np.stack([before.odom_from_base, after.odom_from_base])
        share = (stamp_ns - self._stamps[right - 1]) / (self._stamps[right] - self._stamps[right - 1])
        return OdometryAt(
            before.frame_id,
            interpolate(times, poses, np.array([stamp_ns], dtype=np.int64))[0],
            before.covariance,
            before.way_m + share * (after.way_m - before.way_m),
            before.turned_rad + share * (after.turned_rad - before.turned_rad),
            after.velocity,
        )
