"""Variance component estimation: how noisy a log's sensor and odometry really are, and how alike errors are."""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import GraphSolution, State, minimise
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.initialisation import solve_alone
from mcap_landmarks.mapping.log_graph import LandmarkObservations, LogNoise, graph_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Observations of one landmark within so much way and turning are from one place. The map of MRCLAM's robot 3 is 0.107 m
# wrong; half and twice of this change that by at most 5 mm.
_PLACE_M, _PLACE_RAD = 0.25, 0.3
# What was assumed counts as so many residuals, so that an estimate from few stays near it; 100 and 400 change the error
# by 1 mm.
_ASSUMED = 200
# Random vectors that the redundancy is estimated with; 4 and 16 change the error by less than 1 mm.
_PROBES = 8
# Residuals beyond so many sigmas count as that (winsorised): of normal noise that takes half a percent of the variance.
_OUTLIER = 3.0
# Rounds of estimating and solving. Stopped early on purpose: every round believes the one before as much as `_ASSUMED`
# residuals, so few rounds keep a log that says little near what was assumed. With one and with twelve rounds the error
# is 0.111 m, and on made-up drives twelve make maps worse by half and too sure (NEES of 1.6 in place of 0.4).
_ROUNDS = 2
# Sigmas that a round changes by no more than this share of themselves have settled.
_SETTLED = 0.05


@dataclass(frozen=True, slots=True)
class LogSolution:
    """One log on its own: its landmarks' numbers (L,), the state at the minimum of its graph, and the noise found.

    `termination` tells how the search for the noise ended, `iterations` how many the solution took that took most.
    """

    numbers: Ints
    state: State
    noise: LogNoise
    termination: Termination
    iterations: int


def solve_with_its_noise(log: LandmarkObservations, config: BuildMapConfig) -> LogSolution:
    """The minimum of a log's graph under the noise that its own residuals tell of.

    Solving and estimating take turns (iterated variance component estimation: Helmert 1907, Foerstner 1979), twice.
    Converged: the last turn changed no sigma by more than 5 %. The cost is the graph's.
    """
    place = places(log)
    noise = assumed_noise(place, config.odometry)
    numbers, solved = solve_alone(log, noise, config)
    rows = np.searchsorted(numbers, log.landmark)
    change, iterations = 0.0, solved.termination.iterations
    for _ in range(_ROUNDS):
        before, noise = noise, estimate_noise(log, place, noise.odometry, solved)
        solved = minimise(graph_of(log, rows, noise), solved.state, config.robust_dof, config.max_iterations)
        change, iterations = _largest_change(before, noise), max(iterations, solved.termination.iterations)
    termination = Termination(change <= _SETTLED, _ROUNDS, solved.termination.cost)
    return LogSolution(numbers, solved.state, noise, termination, iterations)


def places(log: LandmarkObservations) -> Ints:
    """Number (M,) of the place that each observation of a landmark belongs to; no two landmarks share one."""
    way = np.concatenate([[0.0], np.cumsum(log.motions.distance_m)])[log.pose]
    turned = np.concatenate([[0.0], np.cumsum(log.motions.turn_rad)])[log.pose]
    out = np.empty(len(log.pose), dtype=np.int64)
    place, first = -1, -1
    previous = None
    for row in np.lexsort((log.pose, log.landmark)):
        moved = way[row] - way[first] > _PLACE_M or turned[row] - turned[first] > _PLACE_RAD
        if log.landmark[row] != previous or moved:
            place, first, previous = place + 1, row, log.landmark[row]
        out[row] = place
    return out


def assumed_noise(place: Ints, odometry: OdometryNoise) -> LogNoise:
    """Noise to start with: the covariances as given, and all that was seen from one place as one observation."""
    return LogNoise(odometry, np.ones(2), np.ones(2), np.bincount(place)[place])


def estimate_noise(
    log: LandmarkObservations, place: Ints, odometry: OdometryNoise, solved: GraphSolution, seed: int = 0
) -> LogNoise:
    """Noise of a log from the residuals of its graph, solved with this `odometry` noise.

    Variances are squared residuals over the redundancy that the fit left them (Foerstner 1979; MacKay 1992). How alike
    observations from one place are is the intraclass correlation of ranges and of bearings, by analysis of variance
    (Fisher 1925).
    """
    redundancy = _redundancy(solved, seed)
    numbers = 2 * len(log.pose)
    raw = np.linalg.solve(solved.graph.observation_root, solved.residuals[0][..., None])[..., 0]
    capped = np.clip(raw / np.sqrt(np.diagonal(log.covariance, axis1=1, axis2=2)), -_OUTLIER, _OUTLIER)
    variance = [_blend((capped[:, axis] ** 2).sum(), redundancy[axis:numbers:2].sum()) for axis in (0, 1)]
    alike = np.array([_intraclass_correlation(capped[:, axis], place) for axis in (0, 1)])
    squares, moves = solved.residuals[1] ** 2, len(solved.graph.motion)
    left = redundancy[numbers : numbers + 3 * moves].reshape(-1, 3)
    heading = _blend(squares[:, 0].sum(), left[:, 0].sum()) ** 0.5
    position = _blend(squares[:, 1:].sum(), left[:, 1:].sum()) ** 0.5
    grown = OdometryNoise(
        odometry.position_per_metre_m * position,
        odometry.heading_per_metre_rad * heading,
        odometry.heading_per_radian_rad * heading,
    )
    return LogNoise(grown, np.sqrt(variance), alike, np.bincount(place)[place])


def _largest_change(before: LogNoise, after: LogNoise) -> float:
    """The largest share of a sigma, the odometry's or the sensor's, by which it changed."""
    old, new = (np.array([*astuple(noise.odometry), *noise.scale]) for noise in (before, after))
    return float((np.abs(new - old) / np.maximum(old, 1e-12)).max())


def _redundancy(solved: GraphSolution, seed: int) -> Array:
    """Share of each whitened residual that the fit could not absorb, by random probes (Hutchinson 1990)."""
    jacobian = solved.jacobian
    probes = np.random.default_rng(seed).normal(size=(jacobian.shape[0], _PROBES))
    absorbed = jacobian @ solved.factor.solve(jacobian.T @ probes)
    return np.asarray(1 - (absorbed**2).mean(axis=1))


def _blend(squares: float, left: float) -> float:
    """Variance relative to the assumed one, which counts as so many residuals."""
    return float((squares + _ASSUMED) / (max(left, 0.0) + _ASSUMED))


def _intraclass_correlation(values: Array, place: Ints) -> float:
    """Share of the variance that observations from one place have in common; 1 where little speaks against it."""
    count = np.bincount(place)
    mean = np.bincount(place, values) / count
    repeated = count[place] > 1
    free = int((count[count > 1] - 1).sum())
    if not free:
        return 1.0
    within = ((values - mean[place])[repeated] ** 2).sum() / free
    total = (values[repeated] ** 2).mean()
    alike = min(max(1 - within / total, 0.0), 1.0) if total > 0 else 1.0
    return float((alike * free + _ASSUMED) / (free + _ASSUMED))
