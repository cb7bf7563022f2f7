"""The covariances of poses from single bundles are honest: NEES over hundreds of simulated cases."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.unique_classes import UniqueClassLocalizer
from mcap_landmarks.messages.scene import SceneObjects

from tests.benchmark.worlds import Sensor, World, pose_looking_at, random_world, scene
from tests.estimation.worlds import nees, pose_errors

SENSOR = Sensor(reach_m=9.0)
WORLDS, VIEWS = 12, 30


def views(number: int, map_sigma_m: float) -> tuple[World, list[SceneObjects], list[np.ndarray], list[Array]]:
    """A world, what is seen in it from some poses, which landmark each object is, and the poses."""
    rng = np.random.default_rng((number, 7))
    world = random_world(rng, 12, map_sigma_m=map_sigma_m)
    poses = [pose_looking_at(rng, world.positions_xy[rng.integers(36)], 3.0, 8.0) for _ in range(VIEWS)]
    seen = [scene(rng, world, pose, SENSOR) for pose in poses]
    return world, [one for one, _ in seen], [which for _, which in seen], poses


def nees_of(found: list[tuple[Match, Array]]) -> float:
    located = [(match.pose, match.covariance, pose) for match, pose in found if match.pose is not None]
    assert len(located) > 0.8 * len(found)
    estimate, covariance, truth = (np.array(column) for column in zip(*located, strict=True))
    return nees(pose_errors(estimate, truth), covariance)


@pytest.mark.slow
def test_where_classes_repeat() -> None:
    found: list[tuple[Match, Array]] = []
    for number in range(WORLDS):
        world, scenes, _, poses = views(number, 0.03)
        matches = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig()).match(scenes)
        found += zip(matches, poses, strict=True)
    assert 0.8 < nees_of(found) < 1.25


@pytest.mark.parametrize(
    ("map_sigma_m", "calibrate"), [(0.0, False), (0.03, False), pytest.param(0.0, True, marks=pytest.mark.slow)]
)
def test_where_every_class_stands_for_one_landmark(map_sigma_m: float, calibrate: bool) -> None:
    """On a map that is known well; where its own errors count as much, calibration takes them for the sensor's."""
    found: list[tuple[Match, Array]] = []
    for number in range(WORLDS):
        world, scenes, which, poses = views(number, map_sigma_m)
        names = tuple(f"tag {i}" for i in range(len(world.class_of)))
        tagged = [
            replace(one, hypotheses=tuple(((names[i], 1.0),) for i in rows))
            for one, rows in zip(scenes, which, strict=True)
        ]
        unique = UniqueClassLocalizer(replace(world.landmark_map, classes=names), LocalizeConfig(calibrate=calibrate))
        found += zip(unique.locate(tagged), poses, strict=True)
    assert 0.8 < nees_of(found) < 1.25
