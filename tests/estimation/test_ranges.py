"""Positions from ranges alone: exact without noise, mirrored at a line, honest with noise."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.estimation.ranges import solve_ranges

from tests.estimation.worlds import Array, nees, thesis_like

coordinate = st.floats(-20, 20)
places = st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=6, unique=True).map(np.array)


def far_from_a_line(points: Array) -> bool:
    return bool(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] > 2)


@given(landmarks=places, position=st.tuples(coordinate, coordinate).map(np.array))
@settings(max_examples=50)
def test_exact_ranges_give_the_position(landmarks: Array, position: Array) -> None:
    ranges = np.linalg.norm(landmarks - position, axis=1)
    assume(far_from_a_line(landmarks) and ranges.min() > 0.1)
    solved = solve_ranges(landmarks[None], ranges[None], 0.01)
    np.testing.assert_allclose(solved.position_xy[0, 0], position, atol=1e-3)
    assert solved.chi2[0, 0] < 1e-6
    assert solved.dof[0] == len(landmarks) - 2


@pytest.mark.parametrize(("turn", "shift"), [(0.0, 0.0), (1.2, 30.0), (np.pi / 2, -5.0)])
def test_landmarks_in_a_line_leave_two_positions(turn: float, shift: float) -> None:
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    landmarks = shift + np.array([0.0, 2.0, 4.0])[:, None] * along
    position, mirrored = shift + 3 * along - 1.5 * across, shift + 3 * along + 1.5 * across
    ranges = np.linalg.norm(landmarks - position, axis=1)
    solved = solve_ranges(landmarks[None], ranges[None], 0.01)
    order = np.argsort((solved.position_xy[0] - shift) @ across)
    np.testing.assert_allclose(solved.position_xy[0][order], [position, mirrored], atol=1e-6)
    np.testing.assert_allclose(solved.chi2, 0, atol=1e-9)
    np.testing.assert_array_equal(solved.converged, True)


def test_the_better_position_comes_first_with_its_own_figures() -> None:
    landmarks, position = np.array([[0.0, 0.0], [5.0, 0.2], [10.0, 0.0], [5.0, -2.0]]), np.array([4.0, 3.0])
    ranges = np.add(np.linalg.norm(landmarks - position, axis=1), [0.02, -0.01, 0.01, 0.0])
    variance = np.array([0.01, 0.04, 0.01, 0.02]) ** 2
    solved = solve_ranges(landmarks[None], ranges[None], variance)
    np.testing.assert_allclose(solved.position_xy[0, 0], position, atol=0.05)
    assert solved.position_xy[0, 1, 1] < -1
    for way in (0, 1):
        d = solved.position_xy[0, way] - landmarks
        distance = np.linalg.norm(d, axis=1)
        chi2 = ((ranges - distance) ** 2 / variance).sum()
        assert solved.chi2[0, way] == pytest.approx(chi2)
        outward = d / distance[:, None]
        np.testing.assert_allclose(
            solved.covariance[0, way], np.linalg.inv((outward.T / variance) @ outward), rtol=1e-6
        )
        gradient = outward.T @ ((ranges - distance) / variance)
        np.testing.assert_allclose(gradient, 0, atol=1e-3)
    assert solved.chi2[0, 0] < solved.chi2[0, 1]


def test_ranges_reach_their_bound_on_the_right_side() -> None:
    world = thesis_like(2_000, 5, 0.02, np.radians(0.3), seed=1)
    mask = np.ones(world.range_m.shape, dtype=bool)
    mask[:, 4] = False
    spoilt = world.range_m.copy()
    spoilt[:, 4] = 7.0
    solved = solve_ranges(world.landmarks_xy, spoilt, 0.02**2, mask=mask)
    near = np.linalg.norm(solved.position_xy - world.poses[:, None, :2], axis=2).argmin(axis=1)
    rows = np.arange(len(near))
    covariance = solved.covariance[rows, near]
    good = position_sigma(covariance) < 0.3
    errors = solved.position_xy[rows, near] - world.poses[:, :2]
    assert good.mean() > 0.8
    assert 0.9 <= nees(errors[good], covariance[good]) <= 1.1


def test_what_is_broken_does_not_count() -> None:
    landmarks, position = np.array([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0], [5.0, -2.0]]), np.array([4.0, 3.0])
    ranges = np.tile(np.linalg.norm(landmarks - position, axis=1), (4, 1))
    variance = np.full((4, 4), 1e-4)
    at = np.tile(landmarks, (4, 1, 1))
    ranges[0, 3], at[1, 3, 0], variance[2, 3], variance[3, 3] = np.nan, np.nan, 0.0, np.inf
    solved = solve_ranges(at, ranges, variance)
    np.testing.assert_allclose(solved.position_xy[:, 0], np.tile(position, (4, 1)), atol=1e-6)
    assert solved.dof.tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("sees", [0, 1])
def test_too_few_leave_the_position_open(sees: int) -> None:
    world = thesis_like(3, 3, 0.02, 0.01, seed=3)
    solved = solve_ranges(world.landmarks_xy, world.range_m, 1e-4, mask=np.arange(3) < sees)
    assert np.isfinite(solved.position_xy).all()
    assert solved.dof.tolist() == [0, 0, 0]
    assert not solved.converged.any()
    np.testing.assert_array_equal(solved.covariance, np.tile(np.diag([np.inf, np.inf]), (3, 2, 1, 1)))


def test_two_circles_meet_in_two_points() -> None:
    solved = solve_ranges([[[0.0, 0.0], [6.0, 0.0]]], [[5.0, 5.0]], 1e-4)
    np.testing.assert_allclose(np.sort(solved.position_xy[0, :, 1]), [-4, 4], atol=1e-9)
    np.testing.assert_allclose(solved.position_xy[0, :, 0], 3, atol=1e-9)
    assert solved.dof.tolist() == [0]
    # Each circle's line of sight has its own variance: 1e-4 along (3, 4) / 5 and along (-3, 4) / 5.
    np.testing.assert_allclose(solved.covariance[0], np.tile(np.diag([25 / 18, 25 / 32]) * 1e-4, (2, 1, 1)))
