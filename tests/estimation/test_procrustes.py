"""Weighted Procrustes: the transform that fits points to landmarks best, in closed form."""

import numpy as np
from mcap_landmarks.estimation import procrustes
from mcap_landmarks.geometry import se2

from tests.estimation.worlds import Array

POINTS = np.array([[1.0, 0.0], [3.0, 1.0], [2.0, -2.0], [5.0, 3.0]])


def fitted(landmarks: Array, points: Array, weight: Array) -> Array:
    """Transform (3,) of points (K, 2) to landmarks (K, 2)."""
    columns = (a[:, None] for a in (*landmarks.T, *points.T, weight))
    x, y, cosine, sine = (part[0] for part in procrustes.fit(*columns))
    assert np.hypot(cosine, sine) == np.float64(1) or abs(np.hypot(cosine, sine) - 1) < 1e-15
    return np.array([x, y, np.arctan2(sine, cosine)])


def test_a_transform_is_found_again() -> None:
    move = np.array([4.0, -7.0, 2.5])
    np.testing.assert_allclose(fitted(se2.transform_points(move, POINTS), POINTS, np.ones(4)), move)


def test_a_point_without_weight_does_not_count() -> None:
    move = np.array([4.0, -7.0, -1.5])
    landmarks = se2.transform_points(move, POINTS)
    landmarks[2] = 99
    np.testing.assert_allclose(fitted(landmarks, POINTS, np.array([1.0, 2, 0, 3])), move)


def test_no_other_transform_has_a_smaller_weighted_sum_of_squares() -> None:
    weight = np.array([1.0, 5.0, 0.5, 2.0])
    landmarks = POINTS + np.random.default_rng(0).normal(0, 0.5, POINTS.shape)

    def cost(move: Array) -> float:
        return float(weight @ ((se2.transform_points(move, POINTS) - landmarks) ** 2).sum(axis=1))

    best = fitted(landmarks, POINTS, weight)
    for step in np.concatenate([np.eye(3), -np.eye(3)]) * 1e-3:
        assert cost(best + step) > cost(best)


def test_each_column_is_a_problem_of_its_own() -> None:
    moves = np.array([[1.0, 2.0, 0.5], [-3.0, 0.0, 3.0]])
    landmarks = se2.transform_points(moves[:, None], POINTS)
    points = np.broadcast_to(POINTS, landmarks.shape)
    x, y, cosine, sine = procrustes.fit(*landmarks.T, *points.T, np.ones((4, 2)))
    np.testing.assert_allclose(np.stack([x, y, np.arctan2(sine, cosine)], axis=-1), moves, atol=1e-12)


def test_without_weights_or_with_one_point_heading_is_zero() -> None:
    zero = np.zeros((3, 1))
    assert np.ravel(procrustes.fit(zero, zero, zero, zero, zero)).tolist() == [0, 0, 1, 0]
    assert fitted(np.array([[5.0, 6.0]]), np.array([[1.0, 2.0]]), np.ones(1)).tolist() == [4, 4, 0]
