"""Positions from ranges alone and poses from bearings alone."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mcap_landmarks.estimation.bearings import solve_bearings
from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.estimation.ranges import solve_ranges
from mcap_landmarks.geometry import se2

from tests.estimation.worlds import Array, nees, pose_errors, thesis_like

coordinate = st.floats(-20, 20)
places = st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=6, unique=True).map(np.array)


def far_from_a_line(points: Array) -> bool:
    return bool(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] > 2)


@pytest.mark.slow
@given(landmarks=places, position=st.tuples(coordinate, coordinate).map(np.array))
@settings(deadline=None, derandomize=True)
def test_exact_ranges_give_the_position(landmarks: Array, position: Array) -> None:
    ranges = np.linalg.norm(landmarks - position, axis=1)
    assume(far_from_a_line(landmarks) and ranges.min() > 0.1)
    solved = solve_ranges(landmarks[None], ranges[None], 0.01)
    np.testing.assert_allclose(solved.position_xy[0, 0], position, atol=1e-3)
    assert solved.chi2[0, 0] < 1e-6
    assert solved.dof[0] == len(landmarks) - 2


@given(landmarks=places, pose=st.tuples(coordinate, coordinate, st.floats(-3, 3)).map(np.array))
@settings(deadline=None, derandomize=True)
def test_exact_bearings_give_the_pose(landmarks: Array, pose: Array) -> None:
    local = se2.transform_points(se2.inverse(pose), landmarks)
    bearings = np.arctan2(local[:, 1], local[:, 0])
    assume(np.hypot(local[:, 0], local[:, 1]).min() > 0.1)
    solved = solve_bearings(landmarks[None], bearings[None], 1e-6)
    assume(position_sigma(solved.covariance)[0] < 0.1)  # not on one circle with the landmarks
    np.testing.assert_allclose(se2.between(pose, solved.map_from_base[0]), 0, atol=1e-4)
    assert solved.dof[0] == len(landmarks) - 3


def test_landmarks_in_a_line_leave_two_positions() -> None:
    landmarks, position = np.array([[0.0, 0.0], [2.0, 1.0], [4.0, 2.0]]), np.array([3.0, -1.0])
    ranges = np.linalg.norm(landmarks - position, axis=1)
    solved = solve_ranges(landmarks[None], ranges[None], 0.01)
    mirrored = np.array([1.0, 3.0])
    found = solved.position_xy[0][np.argsort(solved.position_xy[0][:, 1])]
    np.testing.assert_allclose(found, [position, mirrored], atol=1e-6)
    np.testing.assert_allclose(solved.chi2, 0, atol=1e-9)


def test_ranges_reach_their_bound_on_the_right_side() -> None:
    world = thesis_like(5_000, 5, 0.02, np.radians(0.3), seed=1)
    mask = np.ones(world.range_m.shape, dtype=bool)
    mask[:, 4] = False
    spoilt = world.range_m.copy()
    spoilt[:, 4] = np.nan
    solved = solve_ranges(world.landmarks_xy, spoilt, 0.02**2, mask=mask)
    near = np.linalg.norm(solved.position_xy - world.poses[:, None, :2], axis=2).argmin(axis=1)
    rows = np.arange(len(near))
    covariance = solved.covariance[rows, near]
    good = position_sigma(covariance) < 0.3
    errors = solved.position_xy[rows, near] - world.poses[:, :2]
    assert good.mean() > 0.8
    assert 0.9 <= nees(errors[good], covariance[good]) <= 1.1


def test_bearings_reach_their_bound() -> None:
    world = thesis_like(5_000, 5, 0.02, np.radians(0.1), seed=2)
    solved = solve_bearings(world.landmarks_xy, world.bearing_rad, np.radians(0.1) ** 2)
    good = position_sigma(solved.covariance) < 0.3
    assert good.mean() > 0.5
    assert 0.9 <= nees(pose_errors(solved.map_from_base, world.poses)[good], solved.covariance[good]) <= 1.1


@pytest.mark.parametrize("sees", [0, 1, 2])
def test_too_few_leave_everything_open(sees: int) -> None:
    world = thesis_like(3, 3, 0.02, 0.01, seed=3)
    mask = np.arange(3) < sees
    by_bearing = solve_bearings(world.landmarks_xy, world.bearing_rad, 1e-4, mask=mask)
    assert np.isinf(position_sigma(by_bearing.covariance)).all()
    assert np.isfinite(by_bearing.map_from_base).all()
    by_range = solve_ranges(world.landmarks_xy, world.range_m, 1e-4, mask=mask)
    assert np.isfinite(by_range.position_xy).all()
    if sees < 2:
        assert np.isinf(position_sigma(by_range.covariance)).all()


def test_a_circle_with_all_landmarks_leaves_the_pose_open() -> None:
    angle = np.array([0.3, 1.0, 2.0, 4.0])
    landmarks = 5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    bearings = np.arctan2(landmarks[:, 1], landmarks[:, 0] + 5)
    solved = solve_bearings(landmarks[None], bearings[None], 1e-6)
    assert position_sigma(solved.covariance)[0] > 10
