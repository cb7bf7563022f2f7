"""Where odometry leaps, and what of it holds together: one robot's poses in pieces, or several robots' on one topic."""

from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, between, compose, exp, log

Ints = NDArray[np.int64]

NO_PIECE = -1
_NOISE_M, _NOISE_RAD = 0.15, 0.2
"""Steps may be so far from what the velocity foretells, however short they are: slip, jitter of stamps, rounding."""
_MPS2, _RADPS2 = 10.0, 20.0
"""No robot that carries a camera speeds up faster for long: a car that brakes hard stays below one g."""
_USUAL = 3.0
"""Velocities that change by so many times the fastest ones usual in the log (95th percentile) are none of its robot."""
_FASTEST_MPS, _STANDING_MPS, _STANDING_RADPS = 100.0, 0.02, 0.02
"""Beyond the first a step is a leap and not driving; below the others the robot stands."""
_APART_S = 0.5
"""Over a longer gap nobody knows whether what comes goes on where the odometry was."""
_AT_ZERO_M, _AT_ZERO_RAD = 0.01, 0.01
"""Odometry so near to zero, or to where the log began, after a gap, was reset: a robot never stops so exactly."""
_AWAY_M, _AWAY_RAD = 0.5, 0.3
_BRIDGED_S = 0.2
"""Over a leap in a shorter time the velocity tells how the robot went on."""
_BRIDGE_MPS2, _BRIDGE_RADPS2 = 2.0, 2.0
"""So much the velocity may change meanwhile, as small robots speed up."""
_COURSE, _DRIVEN_M = 100, 0.2
"""The side to which the robot drives is looked at over so many messages, if it drives so far in them."""
_LONE = 3
"""Fewer messages somewhere else are outliers, and no robot."""
_TOGETHER = 10
"""So many messages of two robots between each other's tell that there are two."""


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """N poses in pieces: `piece` (N,) rises from 0, `NO_PIECE` for messages that are left out, by reason in `dropped`.

    `poses` (N, 3) are continuous where a leap could be `bridged`; there `slack` (N, 2) says how far they may be off, in
    m and rad. `places` are where several robots were, empty for one.
    """

    piece: Ints
    poses: Array
    slack: Array
    bridged: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    places: tuple[tuple[float, float], ...] = ()


def find_pieces(times_s: Array, poses: Array, segment: Ints | None = None) -> Pieces:
    """What holds together of poses (N, 3) at rising times (N,): threads of motion that one robot can have made.

    Runs of poses without a leap are put together greedily, each with the thread whose last pose and velocity foretell
    it. Threads side by side are several robots; one after the other they are pieces, and where hardly any time lies
    between them one piece, over which the robot is taken to have kept its velocity. `segment` (N,) rises: nothing joins
    two of them.
    """
    if segment is None or not len(segment) or segment[0] == segment[-1]:
        return _pieces_of(times_s, poses)
    cuts = [0, *(np.flatnonzero(np.diff(segment)) + 1).tolist(), len(poses)]
    found = Pieces(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 2)))
    for first, end in pairwise(cuts):
        found = _then(found, _pieces_of(times_s[first:end], poses[first:end]))
    return found


def _then(found: Pieces, more: Pieces) -> Pieces:
    """Pieces, and those that follow them."""
    count = int(found.piece.max(initial=NO_PIECE)) + 1
    return Pieces(
        np.concatenate([found.piece, np.where(more.piece == NO_PIECE, NO_PIECE, more.piece + count)]),
        np.concatenate([found.poses, more.poses]),
        np.concatenate([found.slack, more.slack]),
        found.bridged + more.bridged,
        found.dropped + more.dropped,
        found.places or more.places,
    )


def _pieces_of(times_s: Array, poses: Array) -> Pieces:
    slack = np.zeros((len(poses), 2))
    steep = leaps(times_s, poses)
    if not steep.any():
        return Pieces(np.zeros(len(poses), dtype=np.int64), poses, slack)
    usual = _usual_speeds(times_s, poses)
    threads = _threads(times_s, poses, np.flatnonzero(steep) + 1, usual)
    dropped = Counter[str]()
    threads = _without_lone(threads, dropped)
    if _side_by_side(threads):
        places = tuple((float(poses[rows[0], 0]), float(poses[rows[0], 1])) for rows in threads)
        return Pieces(np.full(len(poses), NO_PIECE), poses, slack, dropped=dropped, places=places)
    threads = _without_still(poses, _without_inner(threads, dropped), dropped)
    return _bridged(times_s, poses, threads, dropped)


def leaps(times_s: Array, poses: Array) -> NDArray[np.bool_]:
    """Which steps (N - 1,) no robot made: too far from what the velocity around them foretells, or back to zero."""
    if len(poses) < 2:
        return np.zeros(0, dtype=np.bool_)
    steps, seconds = between(poses[:-1], poses[1:]), np.maximum(np.diff(times_s), 1e-6)
    velocities = log(steps) / seconds[:, None]
    reach = _reach(seconds, _usual_speeds(times_s, poses))
    count = len(steps)
    beside = (np.r_[1, 0 : count - 1], np.r_[1:count, count - 2]) if count > 1 else ()
    foretold = [exp(velocities[rows] * seconds[:, None]) for rows in beside] or [np.zeros((1, 3))]
    off = np.array([log(between(one, steps)) for one in foretold])
    far = ((np.hypot(off[..., 0], off[..., 1]) > reach[:, 0]) | (np.abs(off[..., 2]) > reach[:, 1])).all(axis=0)
    far |= np.hypot(steps[:, 0], steps[:, 1]) > _NOISE_M + _FASTEST_MPS * seconds
    found: NDArray[np.bool_] = far | ((seconds > _APART_S) & _reset(poses, steps))
    return found


def _reset(poses: Array, steps: Array) -> NDArray[np.bool_]:
    """Which steps (N - 1,) lead from elsewhere back to zero, or to where the log began."""
    back = np.zeros(len(steps), dtype=np.bool_)
    for start in (np.zeros(3), poses[0]):
        off = np.abs(log(between(start, poses[1:])))
        back |= (np.hypot(off[:, 0], off[:, 1]) < _AT_ZERO_M) & (off[:, 2] < _AT_ZERO_RAD)
    away: NDArray[np.bool_] = (np.hypot(steps[:, 0], steps[:, 1]) > _AWAY_M) | (np.abs(steps[:, 2]) > _AWAY_RAD)
    return back & away


def _usual_speeds(times_s: Array, poses: Array) -> tuple[float, float]:
    """How fast the robot drives (m/s) and turns (rad/s) where it does, the 95th percentile; 0 where it never does."""
    seconds = np.maximum(np.diff(times_s), 1e-6)
    velocities = np.abs(log(between(poses[:-1], poses[1:]))) / seconds[:, None]
    forward, turning = np.hypot(velocities[:, 0], velocities[:, 1]), velocities[:, 2]
    driving = forward[(forward > _STANDING_MPS) & (forward < _FASTEST_MPS)]
    turning = turning[(turning > _STANDING_RADPS) & (turning < _FASTEST_MPS)]
    return _most(driving), _most(turning)


def _most(values: Array) -> float:
    return float(np.quantile(values, 0.95)) if len(values) else 0.0


def _reach(seconds: Array, usual: tuple[float, float]) -> Array:
    """How far (..., 2) in m and rad a pose may be from where the velocity puts it after some seconds (...)."""
    changed = [
        np.minimum(2.5 * rate * seconds**2, _USUAL * fastest * seconds)
        for rate, fastest in zip((_MPS2, _RADPS2), usual, strict=True)
    ]
    return np.stack([_NOISE_M + changed[0], _NOISE_RAD + changed[1]], axis=-1)


def _threads(times_s: Array, poses: Array, cuts: Ints, usual: tuple[float, float]) -> list[Ints]:
    """The rows of each thread, by the time of its first."""
    bounds = [0, *cuts.tolist(), len(poses)]
    threads: list[list[int]] = []
    for first, last in pairwise(bounds):
        best, least = None, np.inf
        for thread in threads:
            gap_s = times_s[first] - times_s[thread[-1]]
            if thread[-1] == first - 1 or gap_s > _APART_S:
                continue
            off = between(compose(poses[thread[-1]], exp(_velocity(times_s, poses, thread) * gap_s)), poses[first])
            shares = np.array([np.hypot(off[0], off[1]), abs(off[2])]) / _reach(np.array(gap_s), usual)
            if shares.max() < min(1.0, least):
                best, least = thread, float(shares.max())
        if best is None:
            threads.append(best := [])
        best.extend(range(first, last))
    return [np.array(thread, dtype=np.int64) for thread in threads]


def _velocity(times_s: Array, poses: Array, rows: list[int]) -> Array:
    """The velocity (3,) at the end of a thread: over its last steps, at most four."""
    few = rows[-5:]
    if len(few) < 2 or times_s[few[-1]] - times_s[few[0]] <= 0:
        return np.zeros(3)
    found: Array = log(between(poses[few[0]], poses[few[-1]])) / (times_s[few[-1]] - times_s[few[0]])
    return found


def _without_lone(threads: list[Ints], dropped: Counter[str]) -> list[Ints]:
    kept = [rows for rows in threads if len(rows) >= _LONE]
    if not kept:
        return threads
    dropped["odometry messages that leap away, a few at a time"] += sum(
        len(rows) for rows in threads if len(rows) < _LONE
    )
    return kept


def _side_by_side(threads: list[Ints]) -> bool:
    """Whether two threads go on between each other's messages."""
    for i, one in enumerate(threads):
        for other in threads[:i]:
            turns = np.diff(np.searchsorted(one, other))
            if (turns > 0).sum() >= _TOGETHER:
                return True
    return False


def _without_inner(threads: list[Ints], dropped: Counter[str]) -> list[Ints]:
    """The threads that do not lie within a gap of another one."""
    inner = [any(one[0] > other[0] and one[-1] < other[-1] for other in threads) for one in threads]
    for rows, is_inner in zip(threads, inner, strict=True):
        if is_inner:
            dropped["odometry messages that leap away and back"] += len(rows)
    return [rows for rows, is_inner in zip(threads, inner, strict=True) if not is_inner]


def _without_still(poses: Array, threads: list[Ints], dropped: Counter[str]) -> list[Ints]:
    """The threads that move; what leaps to a place and stays there exactly tells nothing."""
    moving = [rows for rows in threads if np.ptp(poses[rows], axis=0).max() > 0]
    if not moving:
        return threads
    still = sum(len(rows) for rows in threads) - sum(len(rows) for rows in moving)
    dropped["odometry messages that leap to a place and stay there"] += still
    return moving


def _bridged(times_s: Array, poses: Array, threads: list[Ints], dropped: Counter[str]) -> Pieces:
    """The pieces of threads that follow each other, put together where hardly any time lies between two."""
    piece, moved, slack, bridged = np.full(len(poses), NO_PIECE), poses.copy(), np.zeros((len(poses), 2)), 0
    number, before = 0, None
    for rows in threads:
        if before is not None:
            gap_s = float(times_s[rows[0]] - times_s[before[-1]])
            if 0 < gap_s <= _BRIDGED_S:
                own = _as_headed(moved[before], poses[rows])
                ahead = _velocity(times_s, moved, before.tolist())
                after = _velocity(times_s[rows], own, list(range(min(len(rows), 5))))
                start = compose(moved[before[-1]], exp((ahead + after) / 2 * gap_s))
                moved[rows] = compose(start, between(own[0], own))
                slack[rows[0]] = np.array([_BRIDGE_MPS2, _BRIDGE_RADPS2]) * gap_s**2 / 2
                bridged += 1
            else:
                number += 1
        piece[rows], before = number, rows
    return Pieces(piece, moved, slack, bridged, +dropped)


def _as_headed(before: Array, poses: Array) -> Array:
    """Poses (N, 3) after a leap with headings that fit their positions.

    Where only the heading leaps, as that of a compass does, the robot seems to drive on to another side of itself.
    """
    courses = _course(before[-_COURSE:]), _course(poses[:_COURSE])
    if courses[0] is None or courses[1] is None:
        return poses
    turned = float(wrap(poses[0, 2] - before[-1, 2]))
    aside = float(wrap(courses[1] - courses[0]))
    if abs(turned) < _NOISE_RAD or abs(wrap(aside + turned)) > abs(turned) / 2:
        return poses
    return np.column_stack([poses[:, :2], wrap(poses[:, 2] - turned)])


def _course(poses: Array) -> float | None:
    """To which side of itself a robot drives, in rad from straight ahead; None where it hardly drives."""
    way = between(poses[:-1], poses[1:])[:, :2].sum(axis=0)
    return float(np.arctan2(way[1], way[0])) if np.hypot(*way) > _DRIVEN_M else None
