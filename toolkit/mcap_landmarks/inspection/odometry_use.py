"""Which odometry messages tell where the robot was: by their poses, or by their velocities where poses tell nothing."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.se2 import Array, compose, exp

_LOST_M2 = 1e3
"""Nodes that lost their way say so with variances of 1,000 m^2 and more (RTAB-Map: 9,999)."""
ALWAYS = 0.9
"""What more than this share of all messages says is how the driver fills them, and tells nothing."""
_MOVED_M, _MOVED_RAD = 0.3, 0.3
"""A twist that adds up to less is noise of a standing robot."""
CHOOSE = "choose another topic with --odom TOPIC, or go on without odometry by --odom none"
"""What to do where a topic's odometry is refused."""
_NOT_FINITE = "odometry messages with numbers that are not finite"


def usable_messages(
    topic: str, values: Array, times_ns: NDArray[np.int64], dropped: Counter[str]
) -> tuple[NDArray[np.bool_], str]:
    """Which messages (N,) can be used; and if it is their twists that can, what is wrong with their poses.

    Raises:
        RecordingError: poses have no orientation, and there are no velocities.
    """
    finite, turned = np.isfinite(values[:, :7]).all(axis=1), np.abs(np.nan_to_num(values[:, 3:7])).sum(axis=1) > 0
    posed, driven = finite & turned, np.isfinite(values[:, 16:]).all(axis=1)
    moves = _moves(times_ns[driven], values[driven])
    if posed.sum() < len(values) / 2:
        what = (
            "have no orientation (their quaternions are zero or NaN)" if np.isfinite(values[:, :3]).any() else "are NaN"
        )
        if moves:
            dropped[_NOT_FINITE] += int((~driven).sum())
            return np.asarray(driven), what
        raise RecordingError(
            f"{topic}: {int((~posed).sum())} of {len(values)} poses {what}, and there are no velocities; {CHOOSE}"
        )
    dropped[_NOT_FINITE] += int((~finite).sum())
    dropped["odometry messages without orientation (a quaternion of zeros)"] += int((finite & ~turned).sum())
    if moves and not np.ptp(values[posed, :7], axis=0).any():
        return np.asarray(posed & driven), "never change"
    with np.errstate(invalid="ignore"):
        lost = posed & (values[:, [7, 11]].max(axis=1) >= _LOST_M2)
    if lost.sum() > ALWAYS * posed.sum():
        lost[:] = False
    dropped["odometry messages that say the robot is lost (variances of 1,000 m^2 and more)"] += int(lost.sum())
    frozen = _frozen(times_ns, values, posed & driven & ~lost) if moves else np.zeros_like(lost)
    dropped["odometry messages whose poses stand still while their velocities do not"] += int(frozen.sum())
    return np.asarray(posed & ~lost & ~frozen), ""


def _moves(times_ns: NDArray[np.int64], values: Array) -> bool:
    """Whether twists tell of a robot that moves."""
    if len(values) < 2:
        return False
    way = np.ptp(added_up(times_ns, values), axis=0)
    return bool(max(way[0], way[1]) > _MOVED_M or way[2] > _MOVED_RAD)


def _frozen(times_ns: NDArray[np.int64], values: Array, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Messages (N,) whose poses are exactly those before, while the twists add up to more than noise."""
    rows = np.flatnonzero(usable)
    same = (values[rows[1:], :7] == values[rows[:-1], :7]).all(axis=1)
    seconds = np.diff(times_ns[rows]) / 1e9
    way = np.abs(values[rows[1:]][:, [16, 17, 21]]) * seconds[:, None] * same[:, None]
    stretch = np.concatenate([[0], np.cumsum(~same)])  # of each row, the number of its run of equal poses
    sums = np.zeros((stretch[-1] + 1, 3))
    np.add.at(sums, stretch[1:], way)
    moved = (np.hypot(sums[:, 0], sums[:, 1]) > _MOVED_M) | (sums[:, 2] > _MOVED_RAD)
    found = np.zeros(len(values), dtype=np.bool_)
    found[rows] = moved[stretch]
    return found


def added_up(times_ns: NDArray[np.int64], values: Array) -> Array:
    """Poses (N, 3) from the twists of messages, each step by the mean of those at its ends."""
    twists = values[:, [16, 17, 21]]
    steps = exp((twists[1:] + twists[:-1]) / 2 * (np.diff(times_ns) / 1e9)[:, None])
    poses = np.zeros((len(twists), 3))
    for i, step in enumerate(steps):
        poses[i + 1] = compose(poses[i], step)
    return poses
