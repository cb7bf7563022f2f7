"""The factor graph of poses and landmarks (Dellaert and Kaess 2017), and its minimum under a robust loss."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from numpy.typing import NDArray

from mcap_landmarks.estimation.robust import student_loss, student_weight
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.angles import wrap

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_ITERATIONS = 50
"""Maps of the demo and of MRCLAM take 1 to 24."""
TOLERANCE = 1e-6
"""The relative fall of the cost that ends a search; the default of Ceres Solver."""
# Shares of the normal equations' diagonal: almost none at first, since starts are good; no more than what leaves a
# millionth of a step; no less than what outweighs rounding, so that the factorisation finds no pivot of zero.
_FIRST_DAMPING, _MOST_DAMPING, _LEAST_DAMPING = 1e-6, 1e6, 1e-12
# A pose on top of a landmark has no bearing to it; this keeps the numbers finite there.
_LEAST_DISTANCE_M = 1e-6


@dataclass(frozen=True, slots=True)
class State:
    """What is sought: poses map_from_base (P, 3) of all logs in a row, and landmarks (L, 2)."""

    poses: Array
    landmarks_xy: Array

    def plus(self, step: Array) -> "State":
        """This state with a step (3 P + 2 L,) added."""
        split = self.poses.size
        poses = self.poses + step[:split].reshape(-1, 3)
        poses[:, 2] = wrap(poses[:, 2])
        return State(poses, self.landmarks_xy + step[split:].reshape(-1, 2))


@dataclass(frozen=True, slots=True)
class Graph:
    """Factors between poses and landmarks. Every `root` whitens: root @ residual has unit covariance.

    M observations: pose and landmark index (M,), range and bearing (M,), root (M, 2, 2). E motions from pose
    `motion_pose` (E,) to the next: relative (E, 3), root (E, 3, 3). Q landmarks known beforehand: index (Q,), xy
    (Q, 2), root (Q, 2, 2); without any, the first pose is held, else shifting and turning everything would cost nothing
    (gauge freedom).
    """

    observation_pose: Ints
    observation_landmark: Ints
    range_m: Array
    bearing_rad: Array
    observation_root: Array
    motion_pose: Ints
    motion: Array
    motion_root: Array
    prior_landmark: Ints
    prior_xy: Array
    prior_root: Array

    def residuals(self, at: State) -> tuple[Array, Array, Array]:
        """Whitened residuals of observations (M, 2), motions (E, 3) and known landmarks (Q, 2)."""
        _, distance, predicted = self._line_of_sight(at)
        observed = np.stack([self.range_m - distance, wrap(self.bearing_rad - predicted)], axis=-1)
        moved = self.motion - se2.between(at.poses[self.motion_pose], at.poses[self.motion_pose + 1])
        moved[:, 2] = wrap(moved[:, 2])
        known = self.prior_xy - at.landmarks_xy[self.prior_landmark]
        pairs = ((self.observation_root, observed), (self.motion_root, moved), (self.prior_root, known))
        a, b, c = ((root @ residual[..., None])[..., 0] for root, residual in pairs)
        return a, b, c

    def jacobian(self, at: State, weight: Array) -> sp.csc_array:
        """Derivatives of the whitened predictions, rows as in `residuals`, observations times sqrt(weight)."""
        d, distance, _ = self._line_of_sight(at)
        zero, one = np.zeros_like(distance), np.ones_like(distance)
        by_pose = _rows(
            [-d[:, 0] / distance, -d[:, 1] / distance, zero], [d[:, 1] / distance**2, -d[:, 0] / distance**2, -one]
        )
        root = self.observation_root * np.sqrt(weight)[:, None, None]
        pose, landmark = 3 * self.observation_pose, at.poses.size + 2 * self.observation_landmark
        first = np.concatenate([root @ by_pose, -root @ by_pose[:, :, :2]], axis=2)
        first_columns = np.stack([pose, pose + 1, pose + 2, landmark, landmark + 1], axis=1)
        start = 3 * self.motion_pose
        second = self.motion_root @ self._motion_derivatives(at)
        known = at.poses.size + 2 * self.prior_landmark
        blocks = (
            (first, first_columns),
            (second, start[:, None] + np.arange(6)),
            (self.prior_root, known[:, None] + np.arange(2)),
        )
        return _sparse(blocks, at.poses.size + at.landmarks_xy.size)

    def _line_of_sight(self, at: State) -> tuple[Array, Array, Array]:
        """From pose to landmark: difference (M, 2), distance (M,), bearing (M,)."""
        pose = at.poses[self.observation_pose]
        d = at.landmarks_xy[self.observation_landmark] - pose[:, :2]
        return d, np.maximum(np.hypot(d[:, 0], d[:, 1]), _LEAST_DISTANCE_M), np.arctan2(d[:, 1], d[:, 0]) - pose[:, 2]

    def _motion_derivatives(self, at: State) -> Array:
        """Derivatives (E, 3, 6) of the relative motions by the earlier and the later pose."""
        a, b = at.poses[self.motion_pose], at.poses[self.motion_pose + 1]
        c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
        dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
        zero, one = np.zeros_like(c), np.ones_like(c)
        return _rows(
            [-c, -s, c * dy - s * dx, c, s, zero],
            [s, -c, -c * dx - s * dy, -s, c, zero],
            [zero, zero, -one, zero, zero, one],
        )


@dataclass(frozen=True, slots=True)
class GraphSolution:
    """The minimum, its robust weights (M,), whitened residuals and the factored normal equations of what is free."""

    graph: Graph
    state: State
    weight: Array
    residuals: tuple[Array, Array, Array]
    jacobian: sp.csc_array
    factor: sla.SuperLU
    free: Ints
    termination: Termination


def minimise(
    graph: Graph, start: State, robust_dof: float, max_iterations: int = MAX_ITERATIONS, tolerance: float = TOLERANCE
) -> GraphSolution:
    """Levenberg-Marquardt (Marquardt 1963) with Student-t weights on the observations, renewed at every step.

    That is an M-estimate with a Cauchy kernel of squared width `robust_dof`, by iteratively reweighted Gauss-Newton:
    the steps don't know how the kernel bends (no correction of Triggs et al. 2000), so they never overshoot for it.

    It ends with the iteration that lowers the cost by no more than `tolerance` of it. That alone could be a step that
    damping made short, so it has converged only if one more whole Gauss-Newton step promises no more either (the
    Newton decrement, Boyd and Vandenberghe 2004, section 9.5). Costs below 1 count as 1: where all fits exactly, a step
    of a thousandth of all standard deviations is short enough.
    """
    free = np.arange(0 if len(graph.prior_landmark) else 3, start.poses.size + start.landmarks_xy.size)
    state, residuals, damping = start, graph.residuals(start), _FIRST_DAMPING
    cost = _cost(residuals, robust_dof)
    iterations, ended = 0, False
    while iterations < max_iterations and not ended:
        iterations, before = iterations + 1, cost
        weight, jacobian = _linearise(graph, state, residuals, robust_dof, free)
        right = _right(jacobian, residuals, weight)
        while damping < _MOST_DAMPING:
            step = np.zeros(start.poses.size + start.landmarks_xy.size)
            step[free] = _factor(jacobian, damping).solve(right)
            trial = state.plus(step)
            trial_residuals = graph.residuals(trial)
            trial_cost = _cost(trial_residuals, robust_dof)
            if trial_cost <= cost:
                state, residuals, cost, damping = trial, trial_residuals, trial_cost, max(damping / 10, _LEAST_DAMPING)
                break
            damping *= 10
        ended = before - cost <= tolerance * cost
    weight, jacobian = _linearise(graph, state, residuals, robust_dof, free)
    factor, right = _factor(jacobian, _LEAST_DAMPING), _right(jacobian, residuals, weight)
    promised = float(right @ factor.solve(right))
    termination = Termination(promised <= tolerance * max(cost, 1.0), iterations, cost)
    return GraphSolution(graph, state, weight, residuals, jacobian, factor, free, termination)


def _linearise(
    graph: Graph, state: State, residuals: tuple[Array, Array, Array], robust_dof: float, free: Ints
) -> tuple[Array, sp.csc_array]:
    """Robust weights (M,) and the weighted Jacobian of the free columns."""
    weight = student_weight((residuals[0] ** 2).sum(axis=1), robust_dof)
    return weight, graph.jacobian(state, weight)[:, free]


def _right(jacobian: sp.csc_array, residuals: tuple[Array, Array, Array], weight: Array) -> Array:
    """Right-hand side of the normal equations."""
    weighted = residuals[0] * np.sqrt(weight)[:, None], residuals[1], residuals[2]
    return np.asarray(jacobian.T @ np.concatenate([r.ravel() for r in weighted]))


def _cost(residuals: tuple[Array, Array, Array], robust_dof: float) -> float:
    robust = student_loss((residuals[0] ** 2).sum(axis=1), robust_dof).sum()
    return float(robust + (residuals[1] ** 2).sum() + (residuals[2] ** 2).sum())


def _factor(jacobian: sp.csc_array, damping: float) -> sla.SuperLU:
    normal = (jacobian.T @ jacobian).tocsc()
    damped = normal + sp.diags_array(damping * normal.diagonal())
    return sla.splu(damped.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _rows(*rows: list[Array]) -> Array:
    """Matrices (N, R, C) from R rows of C entries (N,)."""
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def _sparse(blocks: tuple[tuple[Array, Ints], ...], width: int) -> sp.csc_array:
    """One matrix of dense blocks (N, R, C), stacked downwards, at the columns (N, C)."""
    values, rows, columns, top = [], [], [], 0
    for block, at in blocks:
        count, height, breadth = block.shape
        row = top + np.arange(count * height).reshape(count, height, 1)
        values.append(block.ravel())
        rows.append(np.broadcast_to(row, block.shape).ravel())
        columns.append(np.broadcast_to(at[:, None, :], (count, height, breadth)).ravel())
        top += count * height
    indices = (np.concatenate(rows), np.concatenate(columns))
    return sp.csc_array((np.concatenate(values), indices), shape=(top, width))
