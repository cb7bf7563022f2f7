"""Stretches driven through simulated worlds, their bundles matched one after the other, many in parallel."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from typing import TypeVar, cast

import numpy as np
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import between
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.stage import OdometryAt

from tests.benchmark.worlds import Array, Sensor, World, drive, error, pose_looking_at, scene

LENGTH_M, STEP_M, JOIN_M = 20.0, 1.0, 30.0
CAMERA = Sensor(half_view_rad=np.deg2rad(31.1))
_WRONG_M, _WRONG_DEG = 1.0, 20.0
_CHUNK = 8

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Conditions:
    """What is driven with: the sensor, the share of objects with a wrong class, and objects that are none."""

    sensor: Sensor = field(default_factory=Sensor)
    misclassified: float = 0.0
    spurious: int = 0


def judged(match: Match, pose: Array) -> tuple[bool, bool]:
    """Whether a bundle was localized right, and whether wrongly: more than 1 m or 20 degrees off."""
    if match.pose is None:
        return False, False
    far_m, turned_deg = error(match.pose, pose)
    wrong = far_m > _WRONG_M or turned_deg > _WRONG_DEG
    return not wrong, wrong


def stretch(
    matcher: Matcher, world: World, seed: tuple[int, ...], conditions: Conditions
) -> Iterator[tuple[Match, Array]]:
    """Matches of the bundles of one stretch of 20 m that starts near a landmark, with the true poses (3,)."""
    rng = np.random.default_rng(seed)
    middle = world.positions_xy[rng.integers(0, len(world.positions_xy))]
    truth, odometry = drive(rng, pose_looking_at(rng, middle, 6.0, 10.0), LENGTH_M, STEP_M)
    sequence = SequenceLocalizer(matcher, OdometryNoise(), JOIN_M)
    way_m = turned_rad = 0.0
    for i, (pose, at) in enumerate(zip(truth, odometry, strict=True)):
        if i:
            step = between(odometry[i - 1], at)
            way_m, turned_rad = way_m + float(np.hypot(step[0], step[1])), turned_rad + abs(float(step[2]))
        observed, _ = scene(rng, world, pose, conditions.sensor, None, conditions.misclassified, conditions.spurious)
        yield sequence.localize(observed, OdometryAt("odom", at, np.zeros((3, 3)), way_m, turned_rad)), pose


def in_parallel(one: Callable[[int], T], count: int) -> list[T]:
    """`one(i)` for every i below `count`, in order, on all cores; processes are forked, so `one` may be a closure."""
    cores = os.cpu_count() or 1
    with ProcessPoolExecutor(cores, get_context("fork"), initializer=_prepare, initargs=(one,)) as pool:
        return cast("list[T]", list(pool.map(_call, range(count), chunksize=max(min(_CHUNK, count // (4 * cores)), 1))))


_ready: list[Callable[[int], object]] = []


def _prepare(one: Callable[[int], object]) -> None:
    _ready[:] = [one]


def _call(i: int) -> object:
    return _ready[0](i)
