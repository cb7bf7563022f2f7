"""Matching where a fifth of the objects has a wrong class and two in every bundle are none."""

from collections.abc import Callable, Iterator

import numpy as np
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher

from tests.benchmark.rows import Row
from tests.benchmark.stretches import CAMERA, Conditions, in_parallel, judged, stretch
from tests.benchmark.worlds import Sensor, World, appendix_c, pose_looking_at, random_world, scene

_MISCLASSIFIED, _SPURIOUS = 0.2, 2
_GROUPS = 200


def outlier_rows(seed: int, quick: bool) -> Iterator[Row]:
    """Found and wrong: along stretches of the thesis's own map seen all around, in single bundles, and by a camera.

    A stretch is driven until the robot is localized, 20 m at most; it is found if that is right, and wrong if not.
    """
    cases = 200 if quick else 10_000
    all_around = Conditions(Sensor(), _MISCLASSIFIED, _SPURIOUS)
    found, wrong = _until_localized(appendix_c(np.random.default_rng(seed)), all_around, (seed, 1), cases)
    yield Row("outliers", found, at_least=0.9, cases=cases)
    yield Row("outliers_wrong", wrong, at_most=0.001, cases=cases)
    world = random_world(np.random.default_rng(seed), _GROUPS)
    found, wrong = _single(world, seed, 1000 if quick else 10_000)
    yield Row("outliers_single", found, at_least=0.9, cases=1000 if quick else 10_000)
    yield Row("outliers_single_wrong", wrong, at_most=0.001, cases=1000 if quick else 10_000)
    camera = Conditions(CAMERA, _MISCLASSIFIED, _SPURIOUS)
    few = cases // 10
    found, wrong = _until_localized(world, camera, (seed, 2), few)
    yield Row("outliers_camera", found, cases=few)
    yield Row("outliers_camera_wrong", wrong, cases=few)


def _until_localized(world: World, conditions: Conditions, seed: tuple[int, int], count: int) -> tuple[float, float]:
    matcher = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig())
    shares = np.mean(in_parallel(_first_answer(matcher, world, conditions, seed), count), axis=0)
    return float(shares[0]), float(shares[1])


def _first_answer(
    matcher: Matcher, world: World, conditions: Conditions, seed: tuple[int, int]
) -> Callable[[int], tuple[bool, bool]]:
    def one(i: int) -> tuple[bool, bool]:
        for match, pose in stretch(matcher, world, (*seed, i), conditions):
            if match.pose is not None:
                return judged(match, pose)
        return False, False

    return one


def _single(world: World, seed: int, count: int) -> tuple[float, float]:
    """The same of single bundles, all around."""
    rng = np.random.default_rng((seed, 3))
    scenes, poses = [], []
    for _ in range(count):
        middle = world.positions_xy[rng.integers(0, len(world.positions_xy))]
        poses.append(pose_looking_at(rng, middle, 6.0, 10.0))
        scenes.append(scene(rng, world, poses[-1], Sensor(), None, _MISCLASSIFIED, _SPURIOUS)[0])
    matches = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig()).match(scenes)
    shares = np.mean([judged(match, pose) for match, pose in zip(matches, poses, strict=True)], axis=0)
    return float(shares[0]), float(shares[1])
