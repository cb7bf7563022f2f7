"""Which odometry messages tell where the robot was: by their poses, or by their velocities where poses tell nothing."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.estimation.odometry_pieces import leaps
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.geometry.se2 import Array, between, compose, exp, log

Flags = NDArray[np.bool_]

_LOST_M2 = 1e3
"""Nodes that lost their way say so with variances of 1,000 m^2 and more (RTAB-Map: 9,999)."""
ALWAYS = 0.9
"""What more than this share of all messages says is how the driver fills them, and tells nothing."""
_MOVED_M, _MOVED_RAD = 0.3, 0.3
"""A twist that adds up to less is noise of a standing robot."""
_LENGTHS = 1.5
"""Quaternions whose lengths differ by more are something else, such as degrees; a driver may scale all of them."""
_OVER_S, _SLID_M, _SLID_RAD, _FEW = 0.5, 0.2, 0.3, 0.2
"""Poses are held against twists over such a time, and may differ by so much and half of what the twists tell; where
more than a few do, it is the twists that tell nothing."""
CHOOSE = "choose another topic with --odom TOPIC, or go on without odometry by --odom none"
"""What to do where a topic's odometry is refused."""
_NOT_FINITE = "odometry messages with numbers that are not finite"


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """Which messages (N,) can be used; after those that are `lost` nobody knows how the robot went on.

    If it is their twists that can be used, `by_twist` says what is wrong with their poses.
    """

    usable: Flags
    lost: Flags
    by_twist: str = ""


def usable_messages(topic: str, values: Array, times_ns: NDArray[np.int64], dropped: Counter[str]) -> Use:
    """What of messages (N,) can be used.

    Raises:
        RecordingError: poses have no orientation, and there are no velocities.
    """
    finite, turned = np.isfinite(values[:, :7]).all(axis=1), _turned(values[:, 3:7])
    posed, driven = finite & turned, np.isfinite(values[:, 16:]).all(axis=1)
    moves, none = _moves(times_ns[driven], values[driven]), np.zeros(len(values), dtype=np.bool_)
    if posed.sum() < len(values) / 2:
        what = "have no orientation (their quaternions are none)" if np.isfinite(values[:, :3]).any() else "are NaN"
        if moves:
            dropped[_NOT_FINITE] += int((~driven).sum())
            return Use(np.asarray(driven), none, what)
        raise RecordingError(
            f"{topic}: {int((~posed).sum())} of {len(values)} poses {what}, and there are no velocities; {CHOOSE}"
        )
    dropped[_NOT_FINITE] += int((~finite).sum())
    dropped["odometry messages without orientation (a quaternion of zeros)"] += int((finite & ~turned).sum())
    if moves and not np.ptp(values[posed, :7], axis=0).any():
        return Use(np.asarray(posed & driven), none, "never change")
    lost = _lost(values, posed)
    dropped["odometry messages that say the robot is lost (variances of 1,000 m^2 and more)"] += int(lost.sum())
    if moves:
        frozen = _frozen(times_ns, values, posed & driven & ~lost)
        sliding = _sliding(times_ns, values, posed & driven & ~lost & ~frozen)
        dropped["odometry messages whose poses stand still while their velocities do not"] += int(frozen.sum())
        dropped["odometry messages whose poses move otherwise than their velocities"] += int(sliding.sum())
        lost = lost | frozen | sliding
    return Use(np.asarray(posed & ~lost), lost)


def _turned(quaternions: Array) -> Flags:
    """Which quaternions (N, 4) are rotations: not zero, and of one length."""
    lengths = np.linalg.norm(np.nan_to_num(quaternions), axis=1)
    known = lengths[lengths > 0]
    if len(known) and np.quantile(known, 0.9) > _LENGTHS * np.quantile(known, 0.1):
        return np.zeros(len(lengths), dtype=np.bool_)
    return np.asarray(lengths > 0)


def _lost(values: Array, posed: Flags) -> Flags:
    """Which messages (N,) say that the robot is lost, unless that is how the driver fills them."""
    with np.errstate(invalid="ignore"):
        lost = posed & (values[:, [7, 11]].max(axis=1) >= _LOST_M2)
    return np.asarray(lost & (lost.sum() <= ALWAYS * posed.sum()))


def _moves(times_ns: NDArray[np.int64], values: Array) -> bool:
    """Whether twists tell of a robot that moves."""
    if len(values) < 2:
        return False
    way = np.ptp(added_up(times_ns, values), axis=0)
    return bool(max(way[0], way[1]) > _MOVED_M or way[2] > _MOVED_RAD)


def _frozen(times_ns: NDArray[np.int64], values: Array, usable: Flags) -> Flags:
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


def _sliding(times_ns: NDArray[np.int64], values: Array, usable: Flags) -> Flags:
    """Messages (N,) whose poses move otherwise than their twists tell, though most do as they tell.

    Steps that no robot makes are left to those who look for leaps.
    """
    found, rows = np.zeros(len(values), dtype=np.bool_), np.flatnonzero(usable)
    times_s = (times_ns[rows] - times_ns[rows[:1]]) / 1e9
    poses = np.column_stack([values[rows, :2], yaw_from_quaternion(values[rows, 3:7])])
    told = added_up(times_ns[rows], values[rows])
    ends = np.searchsorted(times_s, times_s + _OVER_S)
    starts = np.flatnonzero(ends < len(rows))
    ends = ends[starts]
    leapt = np.concatenate([[0], np.cumsum(leaps(times_s, poses))])
    way = between(told[starts], told[ends])
    off = np.abs(log(between(way, between(poses[starts], poses[ends]))))
    length, turn = np.hypot(way[:, 0], way[:, 1]), np.abs(way[:, 2])
    wrong = (np.hypot(off[:, 0], off[:, 1]) > _SLID_M + length / 2) | (off[:, 2] > _SLID_RAD + turn / 2)
    wrong &= (leapt[ends] == leapt[starts]) & (times_s[ends] - times_s[starts] < 2 * _OVER_S)
    moving = (length > _SLID_M / 2) | (turn > _SLID_RAD / 2)
    if wrong.sum() > _FEW * max(int(moving.sum()), 1):
        return found  # the twists are of another frame, or no velocities at all
    for start, end in zip(starts[wrong], ends[wrong], strict=True):
        found[rows[start + 1 : end]] = True
    return found


def added_up(times_ns: NDArray[np.int64], values: Array) -> Array:
    """Poses (N, 3) from the twists of messages, each step by the mean of those at its ends."""
    twists = values[:, [16, 17, 21]]
    steps = exp((twists[1:] + twists[:-1]) / 2 * (np.diff(times_ns) / 1e9)[:, None])
    poses = np.zeros((len(twists), 3))
    for i, step in enumerate(steps):
        poses[i + 1] = compose(poses[i], step)
    return poses
