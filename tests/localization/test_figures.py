"""Figures of a small world as they are: what is published of bundles with noise, strays and misread classes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import Array, between, compose, inverse, transform_points
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.scene_objects import pick
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import landmark_map, odometry

NAMES = ("bench", "person", "hydrant")
REACH_M, COUNT, BUNDLES = 7.0, 40, 8
# What is published of each bundle: status, objects matched, log10 of the accidents expected, chi-square, its degrees,
# x, y, heading, and the standard deviations of the position along x and of the heading.
Row = tuple[str, int, float, float, int, float, float, float, float, float]


def world() -> LandmarkMap:
    """Forty landmarks on a lattice, shifted, each known by a covariance of its own, but for some that are unknown."""
    rng = np.random.default_rng(11)
    lattice = np.stack(np.meshgrid(np.arange(7), np.arange(6)), axis=-1).reshape(-1, 2)[:COUNT] * 3.0
    positions = lattice + rng.uniform(-1.1, 1.1, lattice.shape)
    made = landmark_map(positions, tuple(NAMES[i] for i in rng.integers(0, 3, COUNT)))
    sigma = rng.uniform(0.01, 0.05, (COUNT, 2))
    covariances = np.zeros((COUNT, 2, 2))
    covariances[:, 0, 0], covariances[:, 1, 1] = sigma.T**2
    covariances[:, 0, 1] = covariances[:, 1, 0] = 0.3 * sigma[:, 0] * sigma[:, 1]
    covariances[::9] = 0.0
    return replace(made, covariances=covariances)


def poses() -> Array:
    """A drive through the world in a bend."""
    found = [np.array([2.0, 2.0, 0.3])]
    for _ in range(BUNDLES - 1):
        found.append(compose(found[-1], np.array([0.9, 0.0, 0.06])))
    return np.array(found)


def bundle(made: LandmarkMap, pose: Array, number: int) -> SceneObjects:
    """What is seen within the reach, every fifth object misread and every fourth in doubt, and one stray."""
    rng = np.random.default_rng((12, number))
    points = transform_points(inverse(pose), made.positions_xy)
    rows = np.flatnonzero(np.hypot(*points.T) < REACH_M)
    noise = rng.normal(size=(len(rows), 2)) * [0.03, 0.05]
    xy = np.concatenate([points[rows] + noise, rng.uniform(-5, 5, (1, 2))])
    options: list[Hypotheses] = []
    for place, row in enumerate(rows.tolist()):
        name = made.classes[row]
        other = NAMES[(NAMES.index(name) + 1) % 3]
        options.append(
            ((other, 0.9),) if place % 5 == 4 else ((name, 0.6), (other, 0.4)) if place % 4 == 3 else ((name, 1.0),)
        )
    spread = np.tile(np.diag([0.03**2, 0.05**2]), (len(xy), 1, 1))
    spread[0] = 0.0  # unknown
    ids = tuple(str(i) for i in range(len(xy)))
    return SceneObjects(number, "base", ids, (*options, (("bench", 0.8),)), xy, spread, np.zeros(len(xy)))


def every(step: int) -> list[SceneObjects]:
    """The bundles of the drive, with one in so many objects of each."""
    scenes = [bundle(WORLD, pose, number) for number, pose in enumerate(poses())]
    return [pick(scene, range(0, len(scene), step)) for scene in scenes]


def driven(scenes: list[SceneObjects]) -> list[Match]:
    """The drive as a sequence of 8 m, with odometry that is off by some centimetres a step."""
    sequence, rng = SequenceLocalizer(MATCHER, OdometryNoise(), 8.0), np.random.default_rng(13)
    true, at, way_m, turned_rad, found = poses(), np.zeros(3), 0.0, 0.0, []
    for i, scene in enumerate(scenes):
        if i:
            step = between(true[i - 1], true[i]) + rng.normal(size=3) * [0.03, 0.01, 0.01]
            at, way_m, turned_rad = (
                compose(at, step),
                way_m + float(np.hypot(*step[:2])),
                turned_rad + abs(float(step[2])),
            )
        found.append(sequence.localize(scene, odometry(at, way_m, turned_rad)))
    return found


def row(match: Match) -> Row:
    message = match.message
    nothing = (math.nan,) * 5
    told = nothing
    if match.pose is not None and match.covariance is not None:
        told = (*match.pose.tolist(), *np.sqrt(np.diag(match.covariance))[[0, 2]].tolist())
    matched, accidents = len(message.object_ids), math.log10(message.expected_accidental)
    return (message.status.name.lower(), matched, accidents, message.chi2, message.dof, *told)


WORLD = world()
MATCHER = Matcher(MapIndex.build(WORLD), LocalizeConfig())


def assert_rows(found: list[Match], expected: list[Row]) -> None:
    for match, of in zip(found, expected, strict=True):
        made = row(match)
        assert made[:2] == of[:2]
        assert made[2:] == pytest.approx(of[2:], rel=2e-5, abs=2e-6, nan_ok=True)


NAN = math.nan
ALONE: list[Row] = [
    ("localized", 4, -2.96507, 3.06981, 5, 2.02453, 1.99008, 0.304602, 0.0208278, 0.00459923),
    ("ambiguous", 0, -1.78698, 0, 0, NAN, NAN, NAN, NAN, NAN),
    ("localized", 5, -5.52662, 4.66196, 7, 3.68062, 2.60002, 0.418953, 0.0221692, 0.00456836),
    ("localized", 5, -5.49266, 4.56903, 7, 4.53813, 2.95082, 0.480049, 0.0225992, 0.00466784),
    ("localized", 5, -5.6622, 5.18001, 7, 5.30989, 3.35778, 0.540657, 0.0222792, 0.00434461),
    ("localized", 6, -6.54406, 4.21256, 9, 6.10429, 3.85502, 0.60036, 0.0207818, 0.0036583),
    ("localized", 5, -4.24047, 7.80281, 7, 6.80811, 4.36095, 0.660759, 0.0228255, 0.0051158),
    ("localized", 6, -7.75586, 6.53026, 9, 7.55027, 4.8942, 0.717475, 0.022085, 0.00508741),
]
SEQUENCE: list[Row] = [
    ("localized", 4, -2.96507, 3.06981, 5, 2.02453, 1.99008, 0.304602, 0.0208278, 0.00459923),
    ("ambiguous", 4, -1.96507, 3.20805, 8, NAN, NAN, NAN, NAN, NAN),
    ("localized", 5, -5.21251, 6.28563, 10, 3.69156, 2.58567, 0.419701, 0.020067, 0.00453392),
    ("localized", 5, -5.21251, 5.02867, 10, 4.54151, 2.9567, 0.4795, 0.021024, 0.00484874),
    ("localized", 5, -13.8835, 6.02972, 10, 5.31531, 3.36212, 0.540886, 0.0198731, 0.00432068),
    ("localized", 6, -19.5873, 4.84332, 12, 6.10297, 3.8485, 0.600612, 0.0186351, 0.00366964),
    ("localized", 5, -23.5253, 8.248, 10, 6.81379, 4.35558, 0.660638, 0.0198971, 0.00507842),
    ("localized", 6, -34.2133, 7.1579, 12, 7.55168, 4.90184, 0.718298, 0.0196056, 0.00497863),
]
SPARSE: list[Row] = [
    ("no_match", 0, 0.700629, 0, 0, NAN, NAN, NAN, NAN, NAN),
    ("no_match", 0, 0.978205, 0, 0, NAN, NAN, NAN, NAN, NAN),
    ("ambiguous", 0, -1.82294, 0, 0, NAN, NAN, NAN, NAN, NAN),
    ("ambiguous", 0, -2.16776, 0, 0, NAN, NAN, NAN, NAN, NAN),
    ("localized", 3, -6.92859, 3.29314, 7, 5.29045, 3.34497, 0.544018, 0.0244566, 0.00497946),
    ("localized", 3, -9.72118, 2.48079, 6, 6.11193, 3.8402, 0.598114, 0.0255277, 0.00685543),
    ("localized", 3, -12.5497, 2.45606, 6, 6.82861, 4.36771, 0.662742, 0.0268675, 0.00574595),
    ("localized", 3, -19.6747, 4.71628, 6, 7.56716, 4.92733, 0.725633, 0.0257663, 0.00767782),
]


def test_bundles_by_themselves() -> None:
    assert_rows(MATCHER.match(every(3)), ALONE)


def test_the_same_bundles_as_a_sequence() -> None:
    assert_rows(driven(every(3)), SEQUENCE)


def test_a_sequence_of_few_objects_each() -> None:
    assert_rows(driven(every(6)), SPARSE)
