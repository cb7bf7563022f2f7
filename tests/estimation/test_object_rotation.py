"""Objects that were seen twice tell how far the robot turned."""

import numpy as np
import pytest
from mcap_landmarks.estimation.object_rotation import object_turn
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points

PLACES = np.array([[3.0, 1.0], [2.0, -1.5], [-2.0, 2.0], [4.0, -0.5]])
ALL = np.ones((4, 4), dtype=np.bool_)


def seen_from(pose: Array) -> Array:
    return transform_points(inverse(pose), PLACES)


@pytest.mark.parametrize("turn", [-0.6, -0.05, 0.0, 0.3])
def test_a_turn_and_a_step(turn: float) -> None:
    second = seen_from(np.array([0.1, 0.05, turn]))
    assert object_turn(PLACES, second, ALL, np.array([0.1, 0.05])) == pytest.approx(turn, abs=1e-9)
    assert object_turn(PLACES, second, ALL, np.zeros(2)) == pytest.approx(turn, abs=0.06)


def test_what_walks_is_outvoted() -> None:
    second = seen_from(np.array([0.0, 0.0, 0.2]))
    second[1] = second[1] @ np.array([[0.9, -0.4], [0.4, 0.9]])
    assert object_turn(PLACES, second, np.eye(4, dtype=np.bool_), np.zeros(2)) == pytest.approx(0.2, abs=1e-9)


def test_nothing_in_common_tells_nothing() -> None:
    assert object_turn(PLACES[:1], PLACES[3:] * 2, ALL[:1, :1], np.zeros(2)) is None
    assert object_turn(PLACES, PLACES, ~ALL, np.zeros(2)) is None
    assert object_turn(PLACES[:0], PLACES, ALL[:0], np.zeros(2)) is None


def test_two_turns_that_are_as_likely_tell_nothing() -> None:
    first = np.array([[2.0, 0.0]])
    second = np.array([[2 * np.cos(0.3), 2 * np.sin(0.3)], [2 * np.cos(0.3), -2 * np.sin(0.3)]])
    assert object_turn(first, second, ALL[:1, :2], np.zeros(2)) is None
