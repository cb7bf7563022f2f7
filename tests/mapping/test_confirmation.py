"""Which landmarks are confirmed: seen often enough, and no misreading of another one's class."""

from dataclasses import replace

import numpy as np
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.confirmation import confirmed, stood

CONFIG = BuildMapConfig()
SPREAD = np.tile(0.01 * np.eye(2), (2, 1, 1))


def test_a_landmark_needs_as_many_observations_as_are_set() -> None:
    xy, seen = np.array([[0.0, 0.0], [9.0, 0.0]]), np.array([2, 3])
    assert confirmed(xy, SPREAD, seen, CONFIG).tolist() == [False, True]
    assert confirmed(xy, SPREAD, seen, replace(CONFIG, min_sightings=2)).tolist() == [True, True]


def test_a_misread_classs_landmark_is_dropped() -> None:
    """It stands where another stands and was seen less than a tenth as often."""
    xy = np.array([[0.0, 0.0], [0.1, 0.05]])
    assert confirmed(xy, SPREAD, np.array([100, 9]), CONFIG).tolist() == [True, False]
    assert confirmed(xy, SPREAD, np.array([100, 10]), CONFIG).tolist() == [True, True]
    assert confirmed(xy, SPREAD, np.array([19, 5]), replace(CONFIG, misread_share=0.3)).tolist() == [True, False]


def test_a_landmark_with_a_place_of_its_own_stays_however_seldom_it_was_seen() -> None:
    """Both covariances count: 0.02 m^2 in each direction, of which 9.21 are 0.429 m."""
    for gap, stays in ((0.42, False), (0.44, True)):
        xy = np.array([[0.0, 0.0], [0.0, gap]])
        assert confirmed(xy, SPREAD, np.array([100, 5]), CONFIG).tolist() == [True, stays]


def test_one_of_several_others_at_its_place_is_enough() -> None:
    xy = np.array([[0.0, 0.0], [20.0, 0.0], [0.1, 0.0], [0.15, 0.0]])
    spread = np.tile(0.01 * np.eye(2), (4, 1, 1))
    seen = np.array([100, 200, 5, 6])
    assert confirmed(xy, spread, seen, CONFIG).tolist() == [True, True, False, False]
    # Of two that were seen as seldom neither is the other's misreading.
    assert confirmed(xy[2:], spread[2:], seen[2:], CONFIG).tolist() == [True, True]
    assert confirmed(xy[:0], spread[:0], seen[:0], CONFIG).tolist() == []


def test_what_may_have_passed_by_was_not_seen_standing() -> None:
    """A person who walks is 2 m farther on after 1.3 s, a car after 0.2 s; a hydrant stays where it is."""
    classes, times = ("person", "person", "car", "fire hydrant"), np.array([0, 1, 0, 2, 0, 1, 0], dtype=np.int64)
    numbers = np.array([0, 0, 1, 1, 2, 2, 3])
    assert stood(classes, [(numbers, times * 10**9)]).tolist() == [False, True, True, True]
    nobody, moment = np.zeros(0, dtype=np.int64), np.array([0], dtype=np.int64)
    assert stood(("car",), [(moment, moment)]).tolist() == [False]
    assert stood(("car",), [(moment, moment), (nobody, nobody), (moment, moment)]).tolist() == [True]
