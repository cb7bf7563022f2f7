"""Logs come into one frame by the landmarks that they share."""

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation import procrustes
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.common_frame import align, into_one_frame

from tests.mapping.drives import Array

MOVE = np.array([3.0, -2.0, 2.5])
LANDMARKS = np.random.default_rng(3).uniform(-10, 10, (8, 2))


def numbered(*numbers: int, move: Array = np.zeros(3)) -> tuple[np.ndarray, Array]:  # noqa: B008 - not changed
    """Landmarks with these numbers, in the frame of a log that lies at `move`."""
    return np.array(numbers), se2.transform_points(se2.inverse(move), LANDMARKS[list(numbers)])


@pytest.mark.parametrize(("count", "wrong"), [(40, 0), (40, 18), (6, 1), (7, 2), (2, 0)])
def test_two_more_than_half_of_the_points_decide(count: int, wrong: int) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-10, 10, (count, 2))
    onto = se2.transform_points(MOVE, points)
    onto[:wrong] = rng.uniform(-10, 10, (wrong, 2))
    np.testing.assert_allclose(align(points, onto), MOVE, atol=1e-9)


def test_all_points_that_fit_share_in_the_transform() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-10, 10, (30, 2))
    way = rng.uniform(0, 2 * np.pi, 30)
    onto = se2.transform_points(MOVE, points) + 0.1 * np.stack([np.cos(way), np.sin(way)], axis=1)
    columns = (a[:, None] for a in (*onto.T, *points.T, np.ones(30)))
    x, y, cosine, sine = (float(part[0]) for part in procrustes.fit(*columns))
    np.testing.assert_allclose(align(points, onto), [x, y, np.arctan2(sine, cosine)], atol=1e-12)
    onto[0] += 2.0
    moved = align(points, onto)
    assert np.abs(moved - MOVE).max() < 0.1
    without = align(points[1:], onto[1:])
    np.testing.assert_allclose(moved, without, atol=1e-12)


def test_the_first_log_gives_the_frame_and_chains_reach_the_last() -> None:
    """The third shares landmarks with the second alone."""
    second, third = np.array([1.0, 2.0, 0.5]), np.array([-4.0, 0.0, 3.0])
    alone = [numbered(0, 1, 2), numbered(4, 5, 6, move=third), numbered(1, 2, 4, 5, move=second)]
    transforms, numbers, landmarks = into_one_frame(alone, None)
    np.testing.assert_allclose(transforms, [np.zeros(3), third, second], atol=1e-9)
    assert numbers.tolist() == [0, 1, 2, 4, 5, 6]
    np.testing.assert_allclose(landmarks, LANDMARKS[[0, 1, 2, 4, 5, 6]], atol=1e-9)


def test_what_is_known_beforehand_gives_the_frame_and_stays() -> None:
    known = numbered(0, 1, 2)
    off = numbered(0, 1, 2, 3, move=MOVE)
    off[1][2] += 0.3
    transforms, numbers, landmarks = into_one_frame([off], known)
    assert numbers.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(landmarks[:3], known[1])
    assert np.abs(transforms[0] - MOVE).max() < 0.2


def test_the_log_that_shares_most_comes_next() -> None:
    """Its place is then the one that the others' transforms rest on."""
    bent = numbered(2, 3, 4, 5)
    bent[1][2:] += [0.0, 0.5]
    whole = numbered(0, 1, 2, 3, 4, 5)
    first = numbered(0, 1, 2, 3)
    _, _, landmarks = into_one_frame([first, bent, whole], None)
    np.testing.assert_allclose(landmarks, LANDMARKS[:6], atol=1e-9)


@pytest.mark.parametrize("shared", [0, 1])
def test_a_log_with_too_few_common_landmarks_is_refused(shared: int) -> None:
    alone = [numbered(0, 1, 2), numbered(1, 2, 3), numbered(*([3, 5, 6] if shared else [5, 6]))]
    with pytest.raises(MapError, match=f"log 3 shares {shared} landmarks with the others, but one frame takes two"):
        into_one_frame(alone, None)
