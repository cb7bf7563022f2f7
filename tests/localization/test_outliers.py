"""Wrong classes and objects that are none: what is learned of them, and places found all the same."""

import numpy as np
import pytest
from mcap_landmarks.localization.acceptance import PairDensity
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.local_map import LocalMap
from mcap_landmarks.localization.matching import Matcher

from tests.benchmark.stretches import CAMERA, Conditions, judged, stretch
from tests.benchmark.worlds import Sensor, World, appendix_c, random_world

CONFIG = LocalizeConfig()
SURE, LIKELY = np.array([0.98, 0.01, 0.01]), np.array([0.01, 0.98, 0.01])


def local_map() -> LocalMap:
    density = PairDensity(np.log([1.0, 100.0]), np.log([1e-3, 1e-3]))
    return LocalMap(density, np.full(3, 1 / 3), 30.0, CONFIG)


def see(around: LocalMap, *objects: tuple[float, float, np.ndarray]) -> np.ndarray:
    """One bundle of objects at places, with the likelihoods of their classes."""
    points = np.array([[x, y] for x, y, _ in objects]).reshape(-1, 2)
    spread = np.tile(0.01**2 * np.eye(2), (len(objects), 1, 1))
    return around.update(points, spread, np.array([seen for *_, seen in objects]).reshape(-1, 3))


def test_what_is_not_seen_again_is_likelier_no_object() -> None:
    around = local_map()
    first = see(around, (5.0, 0.0, SURE), (0.0, 8.0, SURE))
    assert np.allclose(around.spurious_of(first), CONFIG.spurious)
    for x in (-6.0, -9.0, -12.0):
        again = see(around, (5.0, 0.0, SURE), (x, 3.0, SURE))
        assert again[0] == first[0]
    stays, missed, fresh = around.spurious_of(np.array([first[0], first[1], again[1]]))
    assert stays == CONFIG.spurious
    assert stays < fresh < missed < 1


def test_many_views_outvote_one_wrong_class() -> None:
    around = local_map()
    for seen in (SURE, SURE, LIKELY, SURE, SURE):
        number = see(around, (5.0, 0.0, seen))
    assert len(around) == 1
    row = int(np.searchsorted(around.numbers, number[0]))
    likely = around.probabilities[row]
    assert likely.argmax() == 0
    assert likely[0] > 0.95
    assert likely.min() >= CONFIG.misread / 3


def first_answers(world: World, conditions: Conditions, count: int) -> tuple[int, int]:
    matcher, found, wrong = Matcher(MapIndex.build(world.landmark_map), CONFIG), 0, 0
    for i in range(count):
        for match, pose in stretch(matcher, world, (77, i), conditions):
            if match.pose is not None:
                right, bad = judged(match, pose)
                found, wrong = found + right, wrong + bad
                break
    return found, wrong


def test_places_are_found_among_wrong_classes_and_strays() -> None:
    found, wrong = first_answers(appendix_c(np.random.default_rng(5)), Conditions(Sensor(), 0.2, 2), 12)
    assert wrong == 0
    assert found >= 11


@pytest.mark.slow
def test_a_narrow_camera_finds_them_on_the_way() -> None:
    found, wrong = first_answers(random_world(np.random.default_rng(6), 100), Conditions(CAMERA, 0.2, 2), 6)
    assert wrong == 0
    assert found >= 3
