"""The factor graph: residuals as worked out by hand, derivatives as differences, minima that are where they must be."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation import robust
from mcap_landmarks.estimation.factor_graph import Graph, GraphSolution, State, minimise
from mcap_landmarks.geometry import se2

from tests.estimation.graphs import SQUARE, graph_of
from tests.estimation.worlds import Array

LEAST_SQUARES = 1e12
"""Degrees of freedom with which all observations keep their whole weight."""


def apart(state: State, seed: int, by: float = 0.2) -> State:
    """Another state nearby, with the same first pose."""
    step = np.random.default_rng(seed).normal(0, by, state.poses.size + state.landmarks_xy.size)
    step[:3] = 0
    return state.plus(step)


def flat(residuals: tuple[Array, Array, Array]) -> Array:
    return np.concatenate([part.ravel() for part in residuals])


def test_a_state_moves_by_a_step_and_keeps_headings_wrapped() -> None:
    state = State(np.array([[1.0, 2.0, 3.0]]), np.array([[5.0, 6.0]]))
    moved = state.plus(np.array([0.1, 0.2, 0.3, 0.4, 0.5]))
    np.testing.assert_allclose(moved.poses, [[1.1, 2.2, 3.3 - 2 * np.pi]])
    np.testing.assert_allclose(moved.landmarks_xy, [[5.4, 6.5]])


def test_residuals_are_measured_minus_predicted_and_whitened() -> None:
    state = State(np.array([[1.0, 2.0, np.pi / 2], [1.0, 4.0, np.pi]]), np.array([[1.0, 5.0]]))
    graph = Graph(
        np.array([0]),
        np.array([0]),
        np.array([3.1]),
        np.array([0.2]),
        np.array([[[10.0, 0.0], [1.0, 5.0]]]),
        np.array([0]),
        np.array([[2.1, 0.2, np.pi / 2 + 0.1]]),
        np.diag([1.0, 10.0, 100.0])[None],
        np.array([0]),
        np.array([[1.5, 4.0]]),
        np.array([[[2.0, 1.0], [0.0, 4.0]]]),
    )
    observed, moved, known = graph.residuals(state)
    np.testing.assert_allclose(observed, [[1.0, 1.1]], atol=1e-9)
    np.testing.assert_allclose(moved, [[0.1, 2.0, 10.0]], atol=1e-9)
    np.testing.assert_allclose(known, [[0.0, -4.0]], atol=1e-9)


@pytest.mark.parametrize(("bearing_rad", "turn_rad"), [(3.0, -3.0), (-3.0, 3.0)])
def test_angles_differ_the_short_way_round(bearing_rad: float, turn_rad: float) -> None:
    state = State(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.1]]), np.array([[-5.0, 0.0]]))
    graph = replace(
        graph_of(state),
        bearing_rad=np.full(2, bearing_rad),
        motion=np.array([[0.0, 0.0, turn_rad]]),
        observation_root=np.tile(np.eye(2), (2, 1, 1)),
        motion_root=np.eye(3)[None],
    )
    observed, moved, _ = graph.residuals(state)
    assert observed[0, 1] == pytest.approx(np.copysign(np.pi - 3.0, -bearing_rad))
    assert moved[0, 2] == pytest.approx((turn_rad - 3.1 + np.pi) % (2 * np.pi) - np.pi)


def test_derivatives_are_the_differences_of_residuals() -> None:
    graph, state = graph_of(SQUARE, np.array([2, 0])), apart(SQUARE, seed=1)
    weight = np.linspace(0.1, 1.0, len(graph.range_m))
    jacobian = graph.jacobian(state, weight).toarray()
    step = 1e-6
    columns = [
        (flat(graph.residuals(state.plus(-step * one))) - flat(graph.residuals(state.plus(step * one)))) / (2 * step)
        for one in np.eye(jacobian.shape[1])
    ]
    expected = np.stack(columns, axis=1)
    expected[: 2 * len(weight)] *= np.sqrt(np.repeat(weight, 2))[:, None]
    np.testing.assert_allclose(jacobian, expected, atol=1e-6)


def test_a_pose_on_top_of_a_landmark_leaves_finite_numbers() -> None:
    state = State(SQUARE.poses.copy(), SQUARE.landmarks_xy.copy())
    state.landmarks_xy[0] = state.poses[1, :2]
    graph = graph_of(SQUARE)
    assert np.isfinite(flat(graph.residuals(state))).all()
    jacobian = graph.jacobian(state, np.ones(len(graph.range_m)))
    assert np.isfinite(jacobian.toarray()).all()


def test_without_noise_the_state_is_found_again_and_the_first_pose_is_held() -> None:
    start = apart(SQUARE, seed=2)
    solved = minimise(graph_of(SQUARE), start, robust_dof=1.0)
    assert solved.termination.converged
    np.testing.assert_array_equal(solved.state.poses[0], SQUARE.poses[0])
    np.testing.assert_allclose(solved.state.poses, SQUARE.poses, atol=1e-6)
    np.testing.assert_allclose(solved.state.landmarks_xy, SQUARE.landmarks_xy, atol=1e-6)
    np.testing.assert_allclose(solved.weight, 1, atol=1e-6)
    assert solved.free.tolist() == list(range(3, 18))


def test_known_landmarks_give_the_frame() -> None:
    move = np.array([3.0, -1.0, 0.7])
    moved = State(se2.compose(move, SQUARE.poses), se2.transform_points(move, SQUARE.landmarks_xy))
    solved = minimise(graph_of(moved, np.array([0, 2])), SQUARE, LEAST_SQUARES)
    np.testing.assert_allclose(solved.state.poses, moved.poses, atol=1e-6)
    np.testing.assert_allclose(solved.state.landmarks_xy, moved.landmarks_xy, atol=1e-6)
    assert solved.free.tolist() == list(range(18))


def noisy(seed: int) -> Graph:
    graph, rng = graph_of(SQUARE), np.random.default_rng(seed)

    def noise(root: Array) -> Array:
        return np.asarray(np.linalg.solve(root, rng.normal(size=(*root.shape[:2], 1)))[..., 0])

    by_observation = noise(graph.observation_root)
    return replace(
        graph,
        range_m=graph.range_m + by_observation[:, 0],
        bearing_rad=graph.bearing_rad + by_observation[:, 1],
        motion=graph.motion + noise(graph.motion_root),
    )


def cost_of(graph: Graph, state: State, dof: float) -> float:
    observed, moved, known = graph.residuals(state)
    loss = robust.student_loss((observed**2).sum(axis=1), dof).sum()
    return float(loss + (moved**2).sum() + (known**2).sum())


@pytest.mark.parametrize("dof", [1.0, LEAST_SQUARES])
def test_the_minimum_is_one_whichever_way_one_steps(dof: float) -> None:
    graph = noisy(1)
    solved = minimise(graph, apart(SQUARE, seed=3), dof)
    assert solved.termination.converged
    assert solved.termination.cost == pytest.approx(cost_of(graph, solved.state, dof))
    for one in np.eye(18)[3:]:
        for way in (-0.01, 0.01):
            assert cost_of(graph, solved.state.plus(way * one), dof) > solved.termination.cost


def test_one_outlier_does_not_move_the_map() -> None:
    graph = noisy(2)
    spoilt = replace(graph, range_m=graph.range_m + 5.0 * (np.arange(12) == 4))
    kept = replace(
        graph,
        **{name: np.delete(getattr(graph, name), 4, axis=0) for name in Graph.__slots__[:5]},
    )
    robustly, without = minimise(spoilt, SQUARE, 1.0), minimise(kept, SQUARE, 1.0)
    np.testing.assert_allclose(robustly.state.landmarks_xy, without.state.landmarks_xy, atol=0.01)
    assert robustly.weight[4] < 1e-3
    assert np.delete(robustly.weight, 4).min() > 0.1
    bent = minimise(spoilt, SQUARE, LEAST_SQUARES)
    assert np.abs(bent.state.landmarks_xy - without.state.landmarks_xy).max() > 0.3


def test_weights_and_residuals_are_those_of_the_minimum() -> None:
    graph = noisy(3)
    solved = minimise(graph, SQUARE, 2.0)
    for ours, again in zip(solved.residuals, graph.residuals(solved.state), strict=True):
        np.testing.assert_array_equal(ours, again)
    squared = (solved.residuals[0] ** 2).sum(axis=1)
    np.testing.assert_allclose(solved.weight, 2 / (2 + squared))
    np.testing.assert_allclose(
        solved.jacobian.toarray(), graph.jacobian(solved.state, solved.weight).toarray()[:, solved.free]
    )
    normal = (solved.jacobian.T @ solved.jacobian).toarray()
    np.testing.assert_allclose(solved.factor.solve(np.eye(15)), np.linalg.inv(normal), rtol=1e-6, atol=1e-12)


def nees_of(solved: GraphSolution) -> float:
    """Squared Mahalanobis distance to the truth, over the number of unknowns."""
    off = solved.state.poses - SQUARE.poses, solved.state.landmarks_xy - SQUARE.landmarks_xy
    free = np.concatenate([part.ravel() for part in off])[solved.free]
    return float(((solved.jacobian @ free) ** 2).sum() / len(solved.free))


def test_the_covariance_of_least_squares_is_honest() -> None:
    nees = [nees_of(minimise(noisy(seed), SQUARE, LEAST_SQUARES)) for seed in range(100)]
    assert 0.9 < np.mean(nees) < 1.1


def test_a_start_far_off_is_reached_by_damping() -> None:
    start = State(np.tile([0.0, 0.0, 0.1], (4, 1)), np.add(SQUARE.landmarks_xy, [1.0, -2.0]))
    start.poses[0] = SQUARE.poses[0]
    solved = minimise(graph_of(SQUARE), start, LEAST_SQUARES)
    assert solved.termination.converged
    np.testing.assert_allclose(solved.state.landmarks_xy, SQUARE.landmarks_xy, atol=1e-4)
