"""Time association: messages of several channels to bundles, in one pass over a recording and in bounded memory."""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.geometry.se2 import between, interpolate
from toolkit.messages.codec import Message
from toolkit.messages.poses import Odometry
from toolkit.stage import Bundle, Channel, OdometryAt

WINDOW_NS = 2 * 10**9
"""How long a bundle waits for its partners, and the widest gap that odometry is interpolated over."""

_KEPT_NS = 3 * WINDOW_NS


@dataclass(slots=True)
class Association:
    """What became of the messages of one recording."""

    bundles: int = 0
    without_odometry: int = 0
    odometry_out_of_order: int = 0
    odometry_not_finite: int = 0


class _Trail:
    """The last seconds of odometry, by stamp."""

    def __init__(self, counts: Association) -> None:
        self._counts = counts
        self._stamps: deque[int] = deque()
        self._steps: deque[OdometryAt] = deque()

    @property
    def latest_ns(self) -> int:
        return self._stamps[-1] if self._stamps else -(2**63)

    def add(self, stamp_ns: int, message: Odometry) -> None:
        pose = message.pose
        if not np.isfinite(pose).all():
            self._counts.odometry_not_finite += 1
            return
        if stamp_ns <= self.latest_ns:
            self._counts.odometry_out_of_order += 1
            return
        way_m = turned_rad = 0.0
        if self._steps:
            last = self._steps[-1]
            forward, left, turn = between(last.odom_from_base, pose).tolist()
            way_m, turned_rad = last.way_m + math.hypot(forward, left), last.turned_rad + abs(turn)
        self._stamps.append(stamp_ns)
        self._steps.append(OdometryAt(message.frame_id, pose, message.planar_covariance, way_m, turned_rad))
        while self._stamps[0] < stamp_ns - _KEPT_NS and len(self._stamps) > 2:
            self._stamps.popleft()
            self._steps.popleft()

    def at(self, stamp_ns: int) -> OdometryAt | None:
        """Odometry at a time between two stamps that are close enough together, else None."""
        right = bisect_left(self._stamps, stamp_ns)
        if right == len(self._stamps):
            return None
        after = self._steps[right]
        if self._stamps[right] == stamp_ns:
            return after
        if right == 0 or self._stamps[right] - self._stamps[right - 1] > WINDOW_NS:
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
        )


def associate(
    messages: Iterable[tuple[Channel[Any], int, Message]],
    primary: Channel[Any],
    counts: Association,
    *,
    with_odometry: bool = True,
) -> Iterator[Bundle]:
    """One bundle per message of the channel `primary`, with odometry interpolated at its stamp if that is wanted.

    `messages` are (channel, log time, message) by log time; every `Odometry` among them is taken as the robot's.
    Stamps are the headers', log time where those are zero. A bundle waits until odometry has passed its stamp, at most
    `WINDOW_NS` of log time; then it goes without. `counts` is kept up to date.
    """
    trail = _Trail(counts)
    waiting: deque[Bundle] = deque()
    for channel, log_time_ns, message in messages:
        stamp_ns = getattr(message, "stamp_ns", 0) or log_time_ns
        if channel == primary:
            bundle = Bundle(stamp_ns, log_time_ns, {channel: message})
            if not with_odometry:
                counts.bundles += 1
                yield bundle
                continue
            waiting.append(bundle)
        elif isinstance(message, Odometry):
            trail.add(stamp_ns, message)
        while waiting and (trail.latest_ns >= waiting[0].stamp_ns or log_time_ns - waiting[0].log_time_ns > WINDOW_NS):
            yield _finish(waiting.popleft(), trail, counts)
    while waiting:
        yield _finish(waiting.popleft(), trail, counts)


def _finish(bundle: Bundle, trail: _Trail, counts: Association) -> Bundle:
    odometry = trail.at(bundle.stamp_ns)
    counts.bundles += 1
    counts.without_odometry += odometry is None
    return Bundle(bundle.stamp_ns, bundle.log_time_ns, bundle.messages, odometry)
