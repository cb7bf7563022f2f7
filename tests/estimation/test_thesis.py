"""The thesis's position solver, as it is: right or mirrored, whatever its guess leads to."""

import numpy as np
from mcap_landmarks.estimation.thesis import solve_position


def test_the_guess_decides_between_the_position_and_its_mirror_image() -> None:
    landmarks, position = np.array([[0.0, 0.0], [5.0, 0.01], [10.0, 0.0]]), np.array([4.0, 3.0])
    ranges = np.linalg.norm(landmarks - position, axis=1)
    np.testing.assert_allclose(solve_position(landmarks, ranges, (4.0, 2.0)).position_xy, position, atol=1e-6)
    assert solve_position(landmarks, ranges, (4.0, -2.0)).position_xy[1] < -2.9


def test_without_a_guess_it_starts_at_the_origin() -> None:
    landmarks, position = np.array([[-3.0, 2.0], [5.0, 3.0], [1.0, -6.0]]), np.array([0.5, 0.4])
    ranges = np.linalg.norm(landmarks - position, axis=1)
    np.testing.assert_allclose(solve_position(landmarks, ranges).position_xy, position, atol=1e-6)
