"""A landmark map from several logs: poses and landmarks optimised together, robustly, with honest covariances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.factor_graph import Graph, Solved, State, minimise
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.common_frame import join
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.log_graph import LogNoise, LogSightings, graph_of, solve_alone, vote
from mcap_landmarks.mapping.variance_components import assumed_noise, estimate_noise, largest_change, places

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Stopped early on purpose: every round believes its start as much as 200 residuals, so that few rounds keep a log that
# says little near what was assumed, and many would not.
_NOISE_ROUNDS = 2
# Sigmas that a round changes by less than this share of themselves have settled.
_SETTLED = 0.05
# 99 % of right sightings lie within this squared distance.
_INLIER = 9.21
_COLUMNS_AT_ONCE = 200


@dataclass(frozen=True, slots=True)
class KnownLandmarks:
    """Landmarks of a map that exists already: numbers (Q,), positions (Q, 2), covariances (Q, 2, 2)."""

    number: Ints
    xy: Array
    covariance: Array


@dataclass(frozen=True, slots=True)
class MapSolution:
    """L landmarks: `number` (L,) rising, positions (L, 2), covariance (L, 2, 2), and how many sightings fit it (L,).

    Per log: poses (N, 3), robust weights (M,), and the noise found. A weight near 0 means that a sighting was taken for
    wrong. Without known landmarks the frame is the first log's, with its first pose as given, and covariances are those
    of a map free to shift and turn as a whole: what remains between landmarks. `chi2` sums the squared whitened
    residuals times their weights. `termination` tells how the last solution of all logs ended, with the iterations of
    whichever on the way to it took most, `noise_terminations` how the search for each log's noise did.
    """

    number: Ints
    landmarks_xy: Array
    covariance: Array
    sightings: Ints
    trajectories: tuple[Array, ...]
    weights: tuple[Array, ...]
    noise: tuple[LogNoise, ...]
    chi2: float
    termination: Termination
    noise_terminations: tuple[Termination, ...]


def solve_map(
    logs: Sequence[LogSightings],
    config: BuildMapConfig,
    known: KnownLandmarks | None = None,
) -> MapSolution:
    """Optimise the poses of all logs and the landmarks they saw (thesis Algorithm 4's task, as a pose-landmark graph).

    Each log is solved alone, its noise estimated, then all are joined by the landmarks they share.

    Raises:
        MapError: no log, a log without a sighting, one that shares fewer than two landmarks with the others, or no
            convergence.
    """
    if not logs or not all(len(log.pose) for log in logs):
        raise MapError("a log without a single landmark sighting cannot be mapped; leave it out")
    alone = [_solve_with_its_noise(log, config) for log in logs]
    parts = [(log.numbers, log.solved.state.landmarks_xy) for log in alone]
    transforms, numbers, landmarks = join(parts, None if known is None else (known.number, known.xy))
    pairs = zip(transforms, alone, strict=True)
    poses = np.concatenate([se2.compose(transform, log.solved.state.poses) for transform, log in pairs])
    noise = tuple(log.noise for log in alone)
    graph = _stack(logs, noise, numbers, known)
    solved = minimise(graph, State(poses, landmarks), config.robust_dof, config.max_iterations)
    most = max(solved.termination.iterations, *(log.iterations for log in alone))
    if len(logs) > 1:
        start = _vote_again(logs, graph, solved.state, config.robust_dof)
        solved = minimise(graph, start, config.robust_dof, config.max_iterations)
    termination = replace(solved.termination, iterations=max(most, solved.termination.iterations))
    _check(termination, len(logs))
    lengths, counts = [len(log) for log in logs], [len(log.pose) for log in logs]
    squares = (solved.residuals[0] ** 2).sum(axis=1) * solved.weight
    return MapSolution(
        numbers,
        solved.state.landmarks_xy,
        _landmark_covariances(solved, free_frame=known is None),
        _fitting(logs, noise, solved),
        tuple(np.split(solved.state.poses, np.cumsum(lengths)[:-1])),
        tuple(np.split(solved.weight, np.cumsum(counts)[:-1])),
        noise,
        float(squares.sum() + (solved.residuals[1] ** 2).sum() + (solved.residuals[2] ** 2).sum()),
        termination,
        tuple(log.termination for log in alone),
    )


def _check(ended: Termination, logs: int) -> None:
    """Refuse a graph that has not converged.

    Raises:
        MapError: as it says.
    """
    if not ended.converged:
        fewer = "map fewer logs at once, " if logs > 1 else ""
        raise MapError(
            f"poses and landmarks did not converge in {ended.iterations} iterations; {fewer}check the odometry "
            "(`info --check`), or set a larger build_map.max_iterations or, where odometry is worse than that, "
            "build_map.odometry_heading_rad"
        )


@dataclass(frozen=True, slots=True)
class _LogSolution:
    """One log on its own: its landmarks' numbers, the minimum, the noise found, and how the search for that ended.

    `iterations`: of the solution on the way that took most.
    """

    numbers: Ints
    solved: Solved
    noise: LogNoise
    termination: Termination
    iterations: int


def _solve_with_its_noise(log: LogSightings, config: BuildMapConfig) -> _LogSolution:
    place = places(log)
    noise = assumed_noise(place, config.odometry)
    numbers, solved = solve_alone(log, noise, config)
    rows = np.searchsorted(numbers, log.landmark)
    before, iterations = noise, solved.termination.iterations
    for _ in range(_NOISE_ROUNDS):
        before, noise = noise, estimate_noise(log, place, noise.odometry, solved)
        solved = minimise(graph_of(log, rows, noise), solved.state, config.robust_dof, config.max_iterations)
        iterations = max(iterations, solved.termination.iterations)
    settled = largest_change(before, noise) <= _SETTLED
    ended = Termination(settled, _NOISE_ROUNDS, solved.termination.cost)
    return _LogSolution(numbers, solved, noise, ended, iterations)


def _stack(
    logs: Sequence[LogSightings], noise: Sequence[LogNoise], numbers: Ints, known: KnownLandmarks | None
) -> Graph:
    """The graphs of all logs as one, poses in a row, with the known landmarks."""
    rows = [np.searchsorted(numbers, log.landmark) for log in logs]
    graphs = [graph_of(log, row, n) for log, row, n in zip(logs, rows, noise, strict=True)]
    before = np.cumsum([0, *(len(log) for log in logs)])[:-1]
    none = graphs[0]
    inverse_root = none.prior_root if known is None else np.linalg.inv(np.linalg.cholesky(known.covariance))
    return Graph(
        np.concatenate([g.seen_pose + b for g, b in zip(graphs, before, strict=True)]),
        np.concatenate([g.seen_landmark for g in graphs]),
        np.concatenate([g.range_m for g in graphs]),
        np.concatenate([g.bearing_rad for g in graphs]),
        np.concatenate([g.seen_root for g in graphs]),
        np.concatenate([g.motion_pose + b for g, b in zip(graphs, before, strict=True)]),
        np.concatenate([g.motion for g in graphs]),
        np.concatenate([g.motion_root for g in graphs]),
        none.prior_landmark if known is None else np.searchsorted(numbers, known.number),
        none.prior_xy if known is None else known.xy,
        inverse_root,
    )


def _vote_again(logs: Sequence[LogSightings], graph: Graph, at: State, robust_dof: float) -> State:
    """Landmarks where the sightings of all logs together want them: one log alone may have been misled."""
    before = np.cumsum([0, *(len(log) for log in logs)])[:-1]
    points = [log.points_xy(at.poses[b : b + len(log)]) for log, b in zip(logs, before, strict=True)]
    variance = np.concatenate([log.variance() for log in logs])
    moved = vote(np.concatenate(points), variance, graph.seen_landmark, at.landmarks_xy, robust_dof)
    return State(at.poses, moved)


def _fitting(logs: Sequence[LogSightings], noise: Sequence[LogNoise], solved: Solved) -> Ints:
    """How many sightings (L,) of each landmark lie where it is, each by its own covariance alone."""
    graph = solved.graph
    raw = np.linalg.solve(graph.seen_root, solved.residuals[0][..., None])[..., 0]
    scaled = raw / np.concatenate(
        [np.broadcast_to(n.scale, (len(log.pose), 2)) for log, n in zip(logs, noise, strict=True)]
    )
    covariance = np.concatenate([log.covariance for log in logs])
    squared = np.einsum("mi,mi->m", scaled, np.linalg.solve(covariance, scaled[..., None])[..., 0])
    return np.bincount(graph.seen_landmark[squared <= _INLIER], minlength=len(solved.state.landmarks_xy))


def _landmark_covariances(solved: Solved, *, free_frame: bool) -> Array:
    """Covariances (L, 2, 2) of the landmarks; in a free frame without what moves all of them as one rigid body.

    That part says where the robot stood when it switched on, not how good the map is (inner constraints: Meissl 1969).
    """
    xy, width = solved.state.landmarks_xy, len(solved.free)
    first = width - xy.size
    blocks = np.empty((len(xy), 2, 2))
    for start in range(0, xy.size, _COLUMNS_AT_ONCE):
        columns = np.arange(start, min(start + _COLUMNS_AT_ONCE, xy.size))
        part = _columns(solved, first + columns)[first:]
        for axis in (0, 1):
            own = columns[axis::2]
            blocks[own // 2, :, axis] = part.reshape(-1, 2, len(columns))[own // 2, :, own - start]
    if not free_frame:
        return blocks
    centred = xy - xy.mean(axis=0)
    rigid = np.zeros((xy.size, 3))
    rigid[0::2, 0] = rigid[1::2, 1] = 1
    rigid[0::2, 2], rigid[1::2, 2] = -centred[:, 1], centred[:, 0]
    rigid, _ = np.linalg.qr(rigid)
    right = np.zeros((width, 3))
    right[first:] = rigid
    across = solved.factor.solve(right)[first:].reshape(-1, 2, 3)
    rigid_rows = rigid.reshape(-1, 2, 3)
    common = rigid.T @ across.reshape(-1, 3)
    cross = across @ rigid_rows.swapaxes(1, 2)
    return blocks - cross - cross.swapaxes(1, 2) + rigid_rows @ common @ rigid_rows.swapaxes(1, 2)


def _columns(solved: Solved, columns: Ints) -> Array:
    """Columns (F, C) of the inverse of the normal equations."""
    unit = np.zeros((len(solved.free), len(columns)))
    unit[columns, np.arange(len(columns))] = 1
    return np.asarray(solved.factor.solve(unit))
