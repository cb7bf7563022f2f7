"""Centres of the generator's objects from single scans, against the truth: cases, and what methods make of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mcap_landmarks.geometry.angles import quaternion_from_yaw
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.lidar import thesis
from mcap_landmarks.lidar.beams import echoes, sweep
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.lidar import ANGLE_MAX_RAD, cast, noisy
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M, RobotState
from mcap_landmarks_generator.sensor_specs import LidarSpec
from mcap_landmarks_generator.world import World
from numpy.typing import NDArray

RANGES_M = (2.0, 10.0)
FARTHEST_M = 15.0
_APART_M = 60.0
_VIEW_RAD = np.deg2rad(25.0)
_NEAR_M = 0.8
_LOOKS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One scan: ranges_m (N,), which object stands where in the base frame (2,), and how far the LiDAR is from it."""

    ranges_m: Array
    name: str
    centre_xy: Array
    range_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Of M cases: distance of the object; error of its centre in m under its class, nan where it was not seen; its NEES
    over 2; the thesis's error, nan where it was not seen; the probability that its class has."""

    range_m: Array
    error_m: Array
    nees: Array
    thesis_m: Array
    share: Array


def cases(name: str, variants: Sequence[str], seed: int, count: int, spec: LidarSpec, far_m: float) -> Iterator[Case]:
    """Scans of objects of a class, each alone, 2 m to `far_m` away, in the camera's view; `seed` is the looks'."""
    rng = np.random.default_rng(seed)
    placed = [
        PlacedObject(
            f"{i}",
            catalog.build(name, variants[i % len(variants)], seed + i),
            np.array([[i * _APART_M, 0.0]]),
            float(rng.uniform(0, 2 * np.pi)),
            0.0,
        )
        for i in range(_LOOKS)
    ]
    with World(placed, np.array([0.0, -30.0, 0.0])) as world:
        for number in range(count):
            one = placed[number % len(placed)]
            range_m, bearing = rng.uniform(RANGES_M[0], far_m), rng.uniform(-np.pi, np.pi)
            heading = bearing + rng.uniform(-_VIEW_RAD, _VIEW_RAD)
            lidar = one.route_xy[0] - range_m * np.array([np.cos(bearing), np.sin(bearing)])
            base = lidar - SCAN_IN_BASE_M[0] * np.array([np.cos(heading), np.sin(heading)])
            returns = cast(world, _standing(base, heading), spec, np.zeros(spec.beams, np.int64))
            ranges = noisy(returns.distances_m, spec, rng)
            local = transform_points(inverse(np.array([*base, heading])), one.route_xy[0])
            yield Case(ranges, name, local, range_m)


def _standing(base_xy: Array, heading: float) -> History:
    history = History()
    position = np.array([base_xy[0], base_xy[1], 0.0])
    history.append(RobotState(position, quaternion_from_yaw(heading), np.zeros(2)), standing=True)
    return history


def judge(name: str, variants: Sequence[str], seed: int, count: int, beams: int = 360, far_m: float = 10.0) -> Errors:
    """The errors of both methods over some cases."""
    spec, config = LidarSpec(beams=beams), ClusterConfig()
    shapes, mounted = shapes_of(config), np.eye(4)
    mounted[:3, 3] = SCAN_IN_BASE_M
    angles = np.linspace(0.0, ANGLE_MAX_RAD, beams)
    rows = []
    for case in cases(name, variants, seed, count, spec, far_m):
        ranges = echoes(case.ranges_m, spec.range_min_m, spec.range_max_m)
        found = cluster(sweep(angles, ranges, mounted), shapes, config)
        rows.append((case.range_m, *_of_centre(found, case), _of_thesis(ranges, case)))
    range_m, error_m, nees, share, thesis_m = np.array(rows).T
    return Errors(range_m, error_m, nees, thesis_m, share)


def _of_centre(found: Sequence[Hypotheses], case: Case) -> tuple[float, float, float]:
    """Error in m, NEES over 2, and probability of the true class; nan where nothing near the truth has it."""
    near = [one for one in found if np.hypot(*(one.positions_xy[-1] - case.centre_xy)) < _NEAR_M + _size_m(case.name)]
    own = [(one, [i for i, name in enumerate(one.names) if name == case.name]) for one in near]
    own = [(one, rows) for one, rows in own if rows]
    if not own:
        return np.nan, np.nan, 0.0
    one, rows = max(own, key=lambda entry: float(entry[0].shares[entry[1]].sum()))
    best = rows[0]
    off = one.positions_xy[best] - case.centre_xy
    nees = float(off @ np.linalg.solve(one.covariances[best], off)) / 2
    return float(np.hypot(*off)), nees, float(one.shares[rows].sum())


def _size_m(name: str) -> float:
    return max(shape.reach_m for shape in shapes_of(ClusterConfig())[name])


def _of_thesis(ranges_m: Array, case: Case) -> float:
    """The thesis's error in m, nan where it sees nothing near the truth."""
    filtered = thesis.filter_view(ranges_m)
    middles = thesis.middle_beams(thesis.binary(filtered))
    points = thesis.places(filtered, middles) + SCAN_IN_BASE_M[:2]
    off: NDArray[np.float64] = np.hypot(*(points - case.centre_xy).T)
    return float(off.min()) if len(off) and off.min() < _NEAR_M + _size_m(case.name) else np.nan


def within(errors: Errors, low_m: float, high_m: float) -> Errors:
    """The cases of some distances."""
    keep = (errors.range_m >= low_m) & (errors.range_m < high_m)
    return replace(
        errors,
        range_m=errors.range_m[keep],
        error_m=errors.error_m[keep],
        nees=errors.nees[keep],
        thesis_m=errors.thesis_m[keep],
        share=errors.share[keep],
    )
