"""Poses from bearings alone: exact without noise, at their bound with it, open where geometry leaves them so."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mcap_landmarks.estimation.bearings import solve_bearings
from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.geometry import se2

from tests.estimation.worlds import Array, nees, pose_errors, thesis_like

coordinate = st.floats(-20, 20)
places = st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=6, unique=True).map(np.array)


def bearings_from(pose: Array, landmarks: Array) -> Array:
    local = se2.transform_points(se2.inverse(pose), landmarks)
    return np.asarray(np.arctan2(local[:, 1], local[:, 0]))


@given(landmarks=places, pose=st.tuples(coordinate, coordinate, st.floats(-3, 3)).map(np.array))
@settings(max_examples=50)
def test_exact_bearings_give_the_pose(landmarks: Array, pose: Array) -> None:
    assume(np.linalg.norm(landmarks - pose[:2], axis=1).min() > 0.1)
    solved = solve_bearings(landmarks[None], bearings_from(pose, landmarks)[None], 1e-6)
    assume(position_sigma(solved.covariance)[0] < 0.1)  # not on one circle with the landmarks
    np.testing.assert_allclose(se2.between(pose, solved.map_from_base[0]), 0, atol=1e-4)
    assert solved.dof[0] == len(landmarks) - 3


def test_the_linear_solution_is_exact_without_noise() -> None:
    """So that no step is needed: its first is its last."""
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(-20, 20, (50, 2)), rng.uniform(-3, 3, 50)])
    landmarks = rng.uniform([85, -65], [115, -35], (50, 5, 2))
    bearings = np.array([bearings_from(pose, xy) for pose, xy in zip(poses, landmarks, strict=True)])
    solved = solve_bearings(landmarks, bearings, 1e-8, max_iterations=1)
    np.testing.assert_allclose(solved.map_from_base, poses, atol=1e-5)


def test_bearings_reach_their_bound() -> None:
    world = thesis_like(2_000, 5, 0.02, np.radians(0.1), seed=2)
    solved = solve_bearings(world.landmarks_xy, world.bearing_rad, np.radians(0.1) ** 2)
    good = position_sigma(solved.covariance) < 0.3
    assert good.mean() > 0.5
    assert 0.9 <= nees(pose_errors(solved.map_from_base, world.poses)[good], solved.covariance[good]) <= 1.1
    assert solved.chi2[good].mean() / 2 == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("spoilt", [np.nan, np.inf])
def test_what_is_masked_or_broken_does_not_count(spoilt: float) -> None:
    landmarks, pose = np.array([[4.0, 1.0], [1.0, 5.0], [-3.0, 2.0], [0.0, -4.0]]), np.array([0.2, 0.1, 0.4])
    bearings = np.tile(bearings_from(pose, landmarks), (3, 1))
    variance, mask = np.full((3, 4), 1e-6), np.ones((3, 4), dtype=bool)
    bearings[0, 2], mask[0, 2] = 1.0, False
    bearings[1, 2] = spoilt
    variance[2, 2] = np.inf if np.isinf(spoilt) else 0.0
    solved = solve_bearings(landmarks, bearings, variance, mask=mask)
    np.testing.assert_allclose(solved.map_from_base, np.tile(pose, (3, 1)), atol=1e-9)
    assert solved.dof.tolist() == [0, 0, 0]
    assert (solved.weights[:, 2] == 0).all()


@pytest.mark.parametrize("sees", [0, 1, 2])
def test_too_few_leave_everything_open(sees: int) -> None:
    world = thesis_like(3, 3, 0.02, 0.01, seed=3)
    solved = solve_bearings(world.landmarks_xy, world.bearing_rad, 1e-4, mask=np.arange(3) < sees)
    assert np.isinf(position_sigma(solved.covariance)).all()
    assert np.isfinite(solved.map_from_base).all()


def test_a_circle_with_all_landmarks_leaves_the_pose_open() -> None:
    angle = np.array([0.3, 1.0, 2.0, 4.0])
    landmarks = 5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    bearings = np.arctan2(landmarks[:, 1], landmarks[:, 0] + 5)
    solved = solve_bearings(landmarks[None], bearings[None], 1e-6)
    assert position_sigma(solved.covariance)[0] > 10
