"""A start for a log's poses and landmarks that needs no truth, and the minimum of its graph from there."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import GraphSolution, State, minimise
from mcap_landmarks.estimation.odometry import Motions, dead_reckoning
from mcap_landmarks.estimation.robust import student_loss
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.log_graph import LandmarkObservations, LogNoise, graph_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Poses of the first stretch, and how it grows: within a stretch dead reckoning must stay right to a radian or so. Half
# and twice as many poses, and growth of 1.25 to 3, give the same maps of MRCLAM and of made-up drives.
_FIRST_POSES = 30
_GROWTH = 1.5
# Observations of a landmark that are tried as its place; 10 and 50 give the same maps.
_CANDIDATES = 25
# Iterations of a stretch that the next one goes on from: a start needs no more.
_ROUGHLY = 8


def solve_alone(log: LandmarkObservations, noise: LogNoise, config: BuildMapConfig) -> tuple[Ints, GraphSolution]:
    """Landmark numbers (L,) of a log and the minimum of its graph, in the frame of its odometry.

    Incremental: it grows from the first poses on, and each stretch starts by dead reckoning from what is already
    solved, so drift never adds up over the whole log.
    """
    numbers, rows = np.unique(log.landmark, return_inverse=True)
    size, poses = min(_FIRST_POSES, len(log)), log.start[None]
    landmarks = np.full((len(numbers), 2), np.nan)
    while True:
        part = log.first(size)
        m = part.motions
        behind = len(poses) - 1
        rest = Motions(m.relative[behind:], m.distance_m[behind:], m.turn_rad[behind:])
        poses = np.concatenate([poses[:-1], dead_reckoning(poses[-1], rest)])
        part_rows = rows[: len(part.pose)]
        landmarks = robust_medoids(part.points_xy(poses), part.variance(), part_rows, landmarks, config.robust_dof)
        known = np.isfinite(landmarks[:, 0])
        compact = np.cumsum(known) - 1
        graph = graph_of(part, compact[part_rows], noise)
        whole = size == len(log)
        iterations = config.max_iterations if whole else _ROUGHLY
        solved = minimise(graph, State(poses, landmarks[known]), config.robust_dof, iterations)
        if whole:
            return numbers, solved
        poses = solved.state.poses
        landmarks[known] = solved.state.landmarks_xy
        size = min(int(size * _GROWTH), len(log))


def robust_medoids(points_xy: Array, variance: Array, rows: Ints, landmarks: Array, robust_dof: float) -> Array:
    """Landmarks (L, 2) moved to one of their observations, if the rest of them agree better with that.

    points_xy (M, 2) are the observations as the poses have them, with variance (M,), of the landmarks `rows` (M,). A
    landmark not known yet is NaN; one without observations stays. Some of each are tried, spread evenly, so that no
    misreading decides: the medoid (Kaufman and Rousseeuw 1987) under the robust loss.
    """
    out = landmarks.copy()
    order = np.argsort(rows, kind="stable")
    bounds = np.searchsorted(rows[order], np.arange(len(landmarks) + 1))
    for i, (start, end) in enumerate(pairwise(bounds)):
        if start == end:
            continue
        own = order[start:end]
        tried = points_xy[own[np.linspace(0, len(own) - 1, min(len(own), _CANDIDATES)).astype(np.int64)]]
        if np.isfinite(landmarks[i, 0]):
            tried = np.concatenate([landmarks[i][None], tried])
        squared = ((tried[:, None] - points_xy[None, own]) ** 2).sum(axis=2) / variance[own]
        out[i] = tried[np.argmin(student_loss(squared, robust_dof).sum(axis=1))]
    return out
