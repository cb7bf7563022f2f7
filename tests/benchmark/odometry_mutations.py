"""What can go wrong once in the odometry of a good log: pure functions of its messages and a generator."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mcap_landmarks.channels import ODOMETRY, TF
from mcap_landmarks.geometry.se2 import Array, between, compose
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.parts import planar_parts
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.stage import RawMessage

from tests.benchmark.log_edits import (
    Log,
    by_time,
    changed,
    moment_in,
    one_row,
    rows_of,
    stamped,
    stretch_of_time,
    with_message,
    without,
)

_MARGIN = 3
"""So many of a topic's first and last messages are left alone by what makes sense within a log only."""


def odometry_number_lost(log: Log, rng: np.random.Generator) -> Log:
    """One odometry message with a quaternion of zeros, or with NaN as quaternion or position."""
    row = one_row(log, ODOMETRY, rng)
    changes: list[Callable[[Odometry], Odometry]] = [
        lambda message: replace(message, orientation_xyzw=np.zeros(4)),
        lambda message: replace(message, orientation_xyzw=np.full(4, np.nan)),
        lambda message: replace(message, position_m=np.full(3, np.nan)),
    ]
    return with_message(log, row, changed(log[row], ODOMETRY, changes[int(rng.integers(3))]))


def odometry_outlier(log: Log, rng: np.random.Generator) -> Log:
    """One pose somewhere else."""
    row, off = one_row(log, ODOMETRY, rng), _far(rng)
    return with_message(log, row, _moved(log[row], lambda pose: pose + off))


def _far(rng: np.random.Generator) -> Array:
    """A difference (3,) of poses of half a metre up to 30 m."""
    distance, direction = 0.5 * 60 ** rng.random(), rng.uniform(-np.pi, np.pi)
    return np.array([distance * np.cos(direction), distance * np.sin(direction), rng.uniform(-1, 1)])


def _moved(raw: RawMessage, move: Callable[[Array], Array]) -> RawMessage:
    """An odometry message with another pose."""

    def change(message: Odometry) -> Odometry:
        position_m, orientation_xyzw = planar_parts(move(message.pose))
        return replace(message, position_m=position_m, orientation_xyzw=orientation_xyzw)

    return changed(raw, ODOMETRY, change)


def _moved_from(log: Log, rng: np.random.Generator, goes_on: Callable[[Array], Array]) -> Log:
    """All odometry from a message on as if that one's pose were another."""
    first = one_row(log, ODOMETRY, rng, _MARGIN)
    then = decode(Odometry, log[first].data).pose
    start = goes_on(then)
    later = {row for row in rows_of(log, ODOMETRY) if row >= first}
    return tuple(
        _moved(raw, lambda pose: compose(start, between(then, pose))) if row in later else raw
        for row, raw in enumerate(log)
    )


def odometry_jumps(log: Log, rng: np.random.Generator) -> Log:
    """From a message on everything is moved."""
    off = np.array([*_far(rng)[:2], 0.0])
    return _moved_from(log, rng, lambda pose: pose + off)


def odometry_reset(log: Log, rng: np.random.Generator) -> Log:
    """From a message on odometry counts from zero."""
    return _moved_from(log, rng, lambda _: np.zeros(3))


def odometry_heading_jumps(log: Log, rng: np.random.Generator) -> Log:
    """From a message on the heading is another, as after a reset of the gyroscope."""
    off = np.array([0.0, 0.0, rng.choice([-1, 1]) * rng.uniform(0.3, np.pi)])
    return _moved_from(log, rng, lambda pose: pose + off)


def odometry_lost_for_a_while(log: Log, rng: np.random.Generator) -> Log:
    """A node that lost its way: its pose is zero and its variances are 9,999, for a while."""
    first, last = stretch_of_time(log, rng, (0.3, 3.0))
    lost = {row for row in rows_of(log, ODOMETRY) if first <= row < last}

    def change(message: Odometry) -> Odometry:
        level = np.array([0.0, 0.0, 0.0, 1.0])
        unknown = np.eye(6) * 9999.0
        return replace(message, position_m=np.zeros(3), orientation_xyzw=level, pose_covariance=unknown)

    return tuple(changed(raw, ODOMETRY, change) if i in lost else raw for i, raw in enumerate(log))


def odometry_frozen(log: Log, rng: np.random.Generator) -> Log:
    """The last pose over and over for two seconds, with or without its velocity."""
    first, last = stretch_of_time(log, rng, (2.0, 2.0))
    rows = [row for row in rows_of(log, ODOMETRY) if first <= row < last]
    held, is_whole, frozen = decode(Odometry, log[rows[0]].data), rng.random() < 0.5, {*rows}

    def change(message: Odometry) -> Odometry:
        if is_whole:
            return replace(held, stamp_ns=message.stamp_ns)
        return replace(message, position_m=held.position_m, orientation_xyzw=held.orientation_xyzw)

    return tuple(changed(raw, ODOMETRY, change) if i in frozen else raw for i, raw in enumerate(log))


def odometry_gap(log: Log, rng: np.random.Generator) -> Log:
    """No odometry for a while."""
    return without(log, rng, (ODOMETRY, TF), (0.3, 5.0))


def odometry_stops(log: Log, rng: np.random.Generator) -> Log:
    """Odometry that ends before the log does."""
    end_ns, topics = moment_in(log, rng, 0.5, 0.95), {ODOMETRY.topic, TF.topic}
    return tuple(raw for raw in log if raw.log_time_ns < end_ns or raw.connection.topic not in topics)


def second_robot(log: Log, rng: np.random.Generator) -> Log:
    """Another robot's odometry on the same topic, a little later each time."""
    off, late_ns = _far(rng) + np.array([2.0, 0.0, 0.0]), 7_000_000
    other = [
        _moved(raw, lambda pose: compose(off, pose))._replace(log_time_ns=raw.log_time_ns + late_ns)
        for raw in (log[row] for row in rows_of(log, ODOMETRY))
    ]
    late = [stamped(raw, lambda stamp_ns: stamp_ns + late_ns) for raw in other]
    return by_time([*log, *late])
