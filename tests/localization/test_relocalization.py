"""Search for a lost robot: what of the local map is tried, and which places are kept."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import compose
from mcap_landmarks.localization.acceptance import PairDensity
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.local_map import LocalMap
from mcap_landmarks.localization.relocalization import Relocalizer, _distinct, _Guess

from tests.localization.small_worlds import PLACE_XY, SIGMA_M, matcher, one_place, seen

MATCHER = matcher(one_place())
POSE = np.array([-4.0, 1.0, 0.1])
LENGTH_M = 32.0


def local_map() -> LocalMap:
    return LocalMap(
        PairDensity(np.log([1.0, 100.0]), np.log([1e-4, 1e-4])), np.full(3, 1 / 3), LENGTH_M, LocalizeConfig()
    )


def observe(around: LocalMap, *places: tuple[float, float]) -> np.ndarray:
    spread = np.tile(SIGMA_M**2 * np.eye(2), (len(places), 1, 1))
    return around.update(np.array(places), spread, np.tile([0.98, 0.01, 0.01], (len(places), 1)))


def test_parts_of_half_the_length_each_are_tried() -> None:
    """Strays of an old age would be forgotten; here each age is just at the end of its part, or beyond."""
    around = local_map()
    for i in range(6):
        for _ in range(2):
            observe(around, (10.0 * i, 20.0), (10.0 * i, 30.0))
        around.predict(np.zeros(3), np.zeros((3, 3)), [15.0, 8.0, 4.0, 2.0, 2.0, 0.0][i])
    np.testing.assert_allclose(around.age_m, np.repeat([31.0, 16.0, 8.0, 4.0, 2.0, 0.0], 2))
    windows = Relocalizer(MATCHER, LENGTH_M)._windows(around)
    assert [len(rows) for rows in windows] == [12, 10, 8, 6, 4, 2]


def test_what_was_observed_again_is_tried_by_itself() -> None:
    around = local_map()
    for _ in range(2):
        observe(around, (0.0, 20.0), (0.0, 30.0))
    observe(around, (0.0, 20.0), (0.0, 30.0), (10.0, 20.0))
    windows = Relocalizer(MATCHER, LENGTH_M)._windows(around)
    assert [rows.tolist() for rows in windows] == [[0, 1, 2], [0, 1]]


def test_one_object_is_nothing_to_look_for() -> None:
    around = local_map()
    observe(around, (0.0, 20.0))
    assert Relocalizer(MATCHER, LENGTH_M).search(around, np.ones(1, dtype=np.bool_)) is None


def test_places_move_with_the_robot_and_are_checked_again() -> None:
    """The second search looks nothing up, and finds the place by what the first one kept."""
    around, relocalizer = local_map(), Relocalizer(MATCHER, LENGTH_M)
    objects = MATCHER.objects(seen(one_place(), POSE, range(5)))
    around.update(objects.points_xy, objects.covariances, objects.probabilities)
    first = relocalizer.search(around, np.ones(5, dtype=np.bool_))
    assert first is not None
    np.testing.assert_allclose(first[0].fits.candidates.pose[0], POSE, atol=1e-6)
    step = np.array([0.5, 0.1, 0.2])
    around.predict(step, np.zeros((3, 3)), 0.6)
    relocalizer.predict(step)
    second = relocalizer.search(around, np.zeros(5, dtype=np.bool_))
    assert second is not None
    np.testing.assert_allclose(second[0].fits.candidates.pose[0], compose(POSE, step), atol=1e-6)
    np.testing.assert_array_equal(second[0].fits.candidates.landmarks[0], range(5))
    np.testing.assert_array_equal(second[1], range(5))
    assert Relocalizer(MATCHER, LENGTH_M).search(around, np.zeros(5, dtype=np.bool_)) is None


def test_each_part_that_is_tried_is_a_test_of_its_own() -> None:
    around, once = local_map(), Relocalizer(MATCHER, LENGTH_M)
    objects = MATCHER.objects(seen(one_place(), POSE, range(5)))
    around.update(objects.points_xy, objects.covariances, objects.probabilities)
    one = once.search(around, np.ones(5, dtype=np.bool_))
    around.predict(np.zeros(3), np.zeros((3, 3)), 17.0)
    again = MATCHER.objects(seen(one_place(), POSE, range(2)))
    around.update(again.points_xy, again.covariances, again.probabilities)
    two = Relocalizer(MATCHER, LENGTH_M).search(around, np.ones(len(around), dtype=np.bool_))
    assert one is not None
    assert two is not None
    assert len(Relocalizer(MATCHER, LENGTH_M)._windows(around)) == 2
    set_of = Relocalizer(MATCHER, LENGTH_M)._set(around, np.arange(5))
    alone = MATCHER.places(set_of, MATCHER.candidates(set_of, np.ones((1, 5), dtype=np.bool_)))[0]
    assert alone is not None
    assert two[0].expected_accidental == pytest.approx(2 * alone.expected_accidental, rel=1e-6)
    assert PLACE_XY.shape == (len(around), 2)


def test_guesses_of_one_place_are_one_with_all_that_any_matched() -> None:
    there = np.array([1.0, 2.0, 0.3])
    found = [
        (1.0, _Guess(there + 0.01, {2: 9, 3: 7, 4: 8})),
        (5.0, _Guess(there, {1: 6, 2: 7})),
        (3.0, _Guess(there + 5.0, {1: 4})),
    ]
    first, second = _distinct(found)
    assert first.pose is there
    assert first.landmark_of == {1: 6, 2: 7, 4: 8}  # 2 is known, and 7 is taken
    assert second.landmark_of == {1: 4}


def test_no_more_guesses_are_kept_than_there_are_places() -> None:
    found = [(float(i), _Guess(np.array([2.0 * i, 0.0, 0.0]), {0: i})) for i in range(50)]
    kept = _distinct(found)
    assert [guess.landmark_of[0] for guess in kept] == list(range(49, 17, -1))
