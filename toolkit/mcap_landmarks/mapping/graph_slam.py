"""A landmark map from several logs: poses and landmarks optimised together, robustly, with honest covariances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.factor_graph import Graph, GraphSolution, State, minimise
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.common_frame import into_one_frame
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.initialisation import robust_medoids
from mcap_landmarks.mapping.log_graph import LandmarkObservations, LogNoise, graph_of
from mcap_landmarks.mapping.map_covariance import landmark_covariances
from mcap_landmarks.mapping.variance_components import LogSolution, solve_with_its_noise

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# 99 % of right observations lie within this squared distance: chi-square with 2 degrees of freedom.
_INLIER = 9.21
WRONG = 0.1
"""Below this weight the joint solution took an observation for wrong: with one degree of freedom, 3 sigmas or more."""


@dataclass(frozen=True, slots=True)
class KnownLandmarks:
    """Landmarks of a map that exists already: numbers (Q,), positions (Q, 2), covariances (Q, 2, 2)."""

    number: Ints
    xy: Array
    covariance: Array


@dataclass(frozen=True, slots=True)
class MapSolution:
    """L landmarks: `number` (L,) rising, positions (L, 2), covariance (L, 2, 2), and how many observations fit it (L,).

    Per log: poses (N, 3), robust weights (M,), and the noise found. A weight near 0 means that an observation was taken
    for wrong. Without known landmarks the frame is the first log's, with its first pose as given, and covariances are
    those of a map free to shift and turn as a whole: what remains between landmarks. `chi2` sums the squared whitened
    residuals times their weights. `termination` tells how the last solution of all logs ended, with the iterations of
    whichever on the way to it took most, `noise_terminations` how the search for each log's noise did.
    """

    number: Ints
    landmarks_xy: Array
    covariance: Array
    observations: Ints
    trajectories: tuple[Array, ...]
    weights: tuple[Array, ...]
    noise: tuple[LogNoise, ...]
    chi2: float
    termination: Termination
    noise_terminations: tuple[Termination, ...]


def solve_map(
    logs: Sequence[LandmarkObservations],
    config: BuildMapConfig,
    known: KnownLandmarks | None = None,
    alone: Sequence[LogSolution] = (),
) -> MapSolution:
    """Optimise the poses of all logs and the landmarks they saw (thesis Algorithm 4's task, as a pose-landmark graph).

    Each log is solved alone and its noise estimated, unless that is known (`alone`), then all come into one frame by
    the landmarks that they share.

    Raises:
        MapError: no log, a log without an observation, one that shares fewer than two landmarks with the others, or no
            convergence.
    """
    if not logs or not all(len(log.pose) for log in logs):
        raise MapError("a log without a single observation of a landmark cannot be mapped; leave it out")
    alone = alone or [solve_with_its_noise(log, config) for log in logs]
    numbers, solved = _solve_together(logs, alone, config, known)
    most = max(solved.termination.iterations, *(log.iterations for log in alone))
    termination = replace(solved.termination, iterations=most)
    _check(termination, len(logs))
    noise = tuple(log.noise for log in alone)
    lengths, counts = [len(log) for log in logs], [len(log.pose) for log in logs]
    squares = (solved.residuals[0] ** 2).sum(axis=1) * solved.weight
    return MapSolution(
        numbers,
        solved.state.landmarks_xy,
        landmark_covariances(solved, free_frame=known is None),
        _fitting(logs, noise, solved),
        tuple(np.split(solved.state.poses, np.cumsum(lengths)[:-1])),
        tuple(np.split(solved.weight, np.cumsum(counts)[:-1])),
        noise,
        float(squares.sum() + (solved.residuals[1] ** 2).sum() + (solved.residuals[2] ** 2).sum()),
        termination,
        tuple(log.termination for log in alone),
    )


def _solve_together(
    logs: Sequence[LandmarkObservations],
    alone: Sequence[LogSolution],
    config: BuildMapConfig,
    known: KnownLandmarks | None,
) -> tuple[Ints, GraphSolution]:
    """Numbers (L,) of all landmarks, and the minimum of the graph of all logs from where each of them got alone."""
    parts = [(log.numbers, log.state.landmarks_xy) for log in alone]
    transforms, numbers, landmarks = into_one_frame(parts, None if known is None else (known.number, known.xy))
    pairs = zip(transforms, alone, strict=True)
    poses = np.concatenate([se2.compose(transform, log.state.poses) for transform, log in pairs])
    graph = _joint_graph(logs, [log.noise for log in alone], numbers, known)
    solved = minimise(graph, State(poses, landmarks), config.robust_dof, config.max_iterations)
    if len(logs) == 1:
        return numbers, solved
    start, most = _relocate(logs, graph, solved.state, config.robust_dof), solved.termination.iterations
    solved = minimise(graph, start, config.robust_dof, config.max_iterations)
    most = max(most, solved.termination.iterations)
    return numbers, replace(solved, termination=replace(solved.termination, iterations=most))


def _check(ended: Termination, logs: int) -> None:
    """Refuse a graph that has not converged.

    Raises:
        MapError: as it says.
    """
    if not ended.converged:
        fewer = "map fewer logs at once, " if logs > 1 else ""
        raise MapError(
            f"poses and landmarks did not converge in {ended.iterations} iterations; {fewer}check odometry and "
            "clocks (`info --check`), or set a larger build_map.max_iterations or, where odometry is worse than that, "
            "build_map.odometry_heading_rad"
        )


def _joint_graph(
    logs: Sequence[LandmarkObservations], noise: Sequence[LogNoise], numbers: Ints, known: KnownLandmarks | None
) -> Graph:
    """The graphs of all logs as one, with the known landmarks."""
    rows = [np.searchsorted(numbers, log.landmark) for log in logs]
    graph = _stack([graph_of(log, row, n) for log, row, n in zip(logs, rows, noise, strict=True)], logs)
    if known is None:
        return graph
    root = np.linalg.inv(np.linalg.cholesky(known.covariance))
    return replace(graph, prior_landmark=np.searchsorted(numbers, known.number), prior_xy=known.xy, prior_root=root)


def _stack(graphs: Sequence[Graph], logs: Sequence[LandmarkObservations]) -> Graph:
    """The graphs of all logs as one, without known landmarks; the poses of all stand in a row."""
    before = np.cumsum([0, *(len(log) for log in logs)])[:-1]
    return Graph(
        np.concatenate([g.observation_pose + b for g, b in zip(graphs, before, strict=True)]),
        np.concatenate([g.observation_landmark for g in graphs]),
        np.concatenate([g.range_m for g in graphs]),
        np.concatenate([g.bearing_rad for g in graphs]),
        np.concatenate([g.observation_root for g in graphs]),
        np.concatenate([g.motion_pose + b for g, b in zip(graphs, before, strict=True)]),
        np.concatenate([g.motion for g in graphs]),
        np.concatenate([g.motion_root for g in graphs]),
        graphs[0].prior_landmark,
        graphs[0].prior_xy,
        graphs[0].prior_root,
    )


def _relocate(logs: Sequence[LandmarkObservations], graph: Graph, at: State, robust_dof: float) -> State:
    """Landmarks where the observations of all logs together want them: one log alone may have been misled."""
    before = np.cumsum([0, *(len(log) for log in logs)])[:-1]
    points = [log.points_xy(at.poses[b : b + len(log)]) for log, b in zip(logs, before, strict=True)]
    variance = np.concatenate([log.variance() for log in logs])
    moved = robust_medoids(np.concatenate(points), variance, graph.observation_landmark, at.landmarks_xy, robust_dof)
    return State(at.poses, moved)


def _fitting(logs: Sequence[LandmarkObservations], noise: Sequence[LogNoise], solved: GraphSolution) -> Ints:
    """How many observations (L,) of each landmark lie where it is, each by its own covariance alone."""
    graph = solved.graph
    raw = np.linalg.solve(graph.observation_root, solved.residuals[0][..., None])[..., 0]
    scaled = raw / np.concatenate(
        [np.broadcast_to(n.scale, (len(log.pose), 2)) for log, n in zip(logs, noise, strict=True)]
    )
    covariance = np.concatenate([log.covariance for log in logs])
    squared = np.einsum("mi,mi->m", scaled, np.linalg.solve(covariance, scaled[..., None])[..., 0])
    return np.bincount(graph.observation_landmark[squared <= _INLIER], minlength=len(solved.state.landmarks_xy))
