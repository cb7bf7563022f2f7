"""Places are found among wrong classes and objects that are none."""

import numpy as np
import pytest
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher

from tests.benchmark.stretches import CAMERA, Conditions, judged, stretch
from tests.benchmark.worlds import Sensor, World, appendix_c, random_world


def first_answers(world: World, conditions: Conditions, count: int) -> tuple[int, int]:
    """How many of so many stretches were first localized rightly, and how many wrongly."""
    matcher, found, wrong = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig()), 0, 0
    for i in range(count):
        for match, pose in stretch(matcher, world, (77, i), conditions):
            if match.pose is not None:
                right, bad = judged(match, pose)
                found, wrong = found + right, wrong + bad
                break
    return found, wrong


@pytest.mark.slow
def test_places_are_found_among_wrong_classes_and_strays() -> None:
    found, wrong = first_answers(appendix_c(np.random.default_rng(5)), Conditions(Sensor(), 0.2, 2), 12)
    assert wrong == 0
    assert found >= 11


@pytest.mark.slow
def test_a_narrow_camera_finds_them_on_the_way() -> None:
    found, wrong = first_answers(random_world(np.random.default_rng(6), 100), Conditions(CAMERA, 0.2, 2), 6)
    assert wrong == 0
    assert found >= 3
