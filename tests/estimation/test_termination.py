"""Every iterative solver says how it ended: converged or not, after how many iterations, at what cost."""

import numpy as np
import pytest
from mcap_landmarks.estimation import robust
from mcap_landmarks.estimation.bearings import solve_bearings
from mcap_landmarks.estimation.calibration import calibrate
from mcap_landmarks.estimation.factor_graph import Graph, GraphSolution, State, minimise
from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.ranges import solve_ranges
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.estimation.thesis import solve_position

from tests.estimation.worlds import Array, thesis_like

NONE, NO_ROWS = np.empty(0, dtype=np.int64), np.empty((0, 3))


def graph_of_landmarks(range_m: Array, bearing_rad: Array, sigma: float = 0.1) -> Graph:
    """A robot that stands at the origin and sees landmark 0 again and again."""
    count = len(range_m)
    root = np.tile(np.eye(2) / sigma, (count, 1, 1))
    zeros = np.zeros(count, dtype=np.int64)
    none = (NONE, NO_ROWS, np.empty((0, 3, 3)), NONE, np.empty((0, 2)), np.empty((0, 2, 2)))
    return Graph(zeros, zeros, range_m, bearing_rad, root, *none)


def solved(range_m: list[float], start: tuple[float, float], max_iterations: int = 50) -> GraphSolution:
    graph = graph_of_landmarks(np.array(range_m), np.zeros(len(range_m)))
    return minimise(graph, State(np.zeros((1, 3)), np.array([start])), 3.0, max_iterations)


def test_poses_count_their_steps_and_sum_their_losses() -> None:
    world = thesis_like(200, 5, 0.05, 0.01, seed=1)
    given = world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance
    plain, heavy = solve_poses(*given), solve_poses(*given, robust_dof=3.0)
    np.testing.assert_allclose(plain.cost, plain.chi2, rtol=1e-12)
    np.testing.assert_allclose(heavy.cost, robust.student_loss(heavy.observation_chi2, 3.0).sum(axis=1), rtol=1e-12)
    assert plain.converged.all()
    assert np.unique(plain.iterations).tolist() == [2, 3, 4]


def test_poses_that_need_more_steps_than_allowed_have_not_converged() -> None:
    world = thesis_like(200, 5, 0.5, 0.1, seed=1)
    given = world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance
    cut = solve_poses(*given, robust_dof=1.0, max_iterations=5)
    free = solve_poses(*given, robust_dof=1.0)
    late = free.iterations > 5
    assert 0 < late.sum() < 200
    np.testing.assert_array_equal(cut.converged, ~late)
    assert (cut.iterations[late] == 5).all()
    assert (cut.cost[late] > free.cost[late]).all()


def test_exact_bearings_have_converged_at_no_cost() -> None:
    landmarks = np.array([[3.0, 0.0], [0.0, 4.0], [-2.0, -2.0]])
    bearings = np.arctan2(landmarks[:, 1], landmarks[:, 0])
    found = solve_bearings(landmarks[None], bearings[None], 1e-4)
    assert found.converged.tolist() == [True]
    assert found.iterations.tolist() == [1]
    assert found.cost[0] == pytest.approx(0, abs=1e-12)


def test_positions_from_ranges_converge_unless_they_are_open() -> None:
    world = thesis_like(300, 4, 0.05, 0.01, seed=2)
    found = solve_ranges(world.landmarks_xy, world.range_m, 0.05**2)
    assert found.converged[:, 0].mean() > 0.95
    assert np.median(found.iterations[:, 0]) <= 5
    assert (found.iterations[found.converged] < 20).all()
    one = solve_ranges(world.landmarks_xy, world.range_m, 0.05**2, mask=np.arange(4) < 1)
    assert not one.converged.any()


def test_the_thesiss_solver_says_what_minpack_said() -> None:
    landmarks = np.array([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]])
    exact = solve_position(landmarks, np.linalg.norm(landmarks - [4.0, 3.0], axis=1), (4.0, 2.0)).termination
    assert exact.converged
    assert 3 < exact.iterations < 20
    assert exact.cost == pytest.approx(0, abs=1e-12)
    impossible = solve_position(landmarks, [1.0, 1.0, 1.0], (4.0, 2.0))
    assert impossible.termination.cost > 100


def test_calibration_converges_and_takes_no_round_where_there_is_nothing() -> None:
    world = thesis_like(50, 4, 0.05, np.radians(0.5), seed=1)
    given = world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance
    ended = calibrate(*given).termination
    assert ended.converged
    assert ended.iterations == 15
    # 50 bundles have five numbers more than their poses each; Student-t weights leave about half of their squares.
    assert ended.cost == pytest.approx(137.1, abs=0.1)
    nothing = calibrate(*given, mask=np.zeros(world.range_m.shape, dtype=bool)).termination
    assert nothing == Termination(converged=True, iterations=0, cost=0.0)


def test_a_graph_that_fits_exactly_has_converged() -> None:
    ended = solved([5.0] * 3, (5.0, 0.0)).termination
    assert ended == Termination(converged=True, iterations=1, cost=0.0)


def test_a_graph_converges_to_the_robust_minimum() -> None:
    found = solved([5.0, 5.0, 5.0, 9.0], (6.0, 0.5))
    ended = found.termination
    assert ended.converged
    assert 1 < ended.iterations < 50
    assert ended.cost == pytest.approx(robust.student_loss((found.residuals[0] ** 2).sum(axis=1), 3.0).sum())
    np.testing.assert_allclose(found.state.landmarks_xy, [[5.0, 0.0]], atol=0.01)


def test_a_graph_that_is_stopped_on_its_way_has_not_converged() -> None:
    ended = solved([5.0, 5.0, 5.0, 9.0], (6.0, 0.5), max_iterations=2).termination
    assert not ended.converged
    assert ended.iterations == 2
    whole = solved([5.0, 5.0, 5.0, 9.0], (6.0, 0.5)).termination
    assert ended.cost > whole.cost
    last = solved([5.0, 5.0, 5.0, 9.0], (6.0, 0.5), max_iterations=whole.iterations).termination
    assert last == whole
