"""One log's part of the graph: its factors, and a start for its poses and landmarks that needs no truth."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import Graph, Solved, State, minimise
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, dead_reckoning, motion_covariance
from mcap_landmarks.estimation.robust import student_loss
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.config import BuildMapConfig

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_FIRST_POSES = 30
_GROWTH = 1.5
_CANDIDATES = 25
# Iterations of a stretch that the next one goes on from: a start needs no more.
_ROUGHLY = 8


@dataclass(frozen=True, slots=True)
class LogSightings:
    """What one log saw: N poses joined by motions from `start` (3,), M sightings from pose number `pose` (M,).

    `landmark` (M,) holds landmark numbers, `range_m` and `bearing_rad` (M,) with `covariance` (M, 2, 2) are as measured
    in the base frame, in the order of time. Two or more poses.
    """

    start: Array
    motions: Motions
    pose: Ints
    landmark: Ints
    range_m: Array
    bearing_rad: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.motions.distance_m) + 1

    def first(self, poses: int) -> "LogSightings":
        """The part of the log up to some number of poses."""
        m, seen = self.motions, slice(0, int(np.searchsorted(self.pose, poses)))
        part = slice(0, poses - 1)
        return LogSightings(
            self.start,
            Motions(m.relative[part], m.distance_m[part], m.turn_rad[part]),
            self.pose[seen],
            self.landmark[seen],
            self.range_m[seen],
            self.bearing_rad[seen],
            self.covariance[seen],
        )

    def points_xy(self, poses: Array) -> Array:
        """Where the sightings (M, 2) lie if the log's poses are these."""
        local = self.range_m[:, None] * np.stack([np.cos(self.bearing_rad), np.sin(self.bearing_rad)], axis=-1)
        return se2.transform_points(poses[self.pose], local)

    def variance(self) -> Array:
        """Variance (M,) of the sightings' places, in all directions together."""
        return np.asarray(self.covariance[:, 0, 0] + self.range_m**2 * self.covariance[:, 1, 1])


@dataclass(frozen=True, slots=True)
class LogNoise:
    """Noise of a log: its odometry's, what multiplies the sigmas of range and bearing (2,), and what sightings share.

    `alike` (2,) is the correlation of the errors of ranges and of bearings to one landmark from one place, `repeats`
    (M,) how many sightings each sighting's place has.
    """

    odometry: OdometryNoise
    scale: Array
    alike: Array
    repeats: Ints

    def sigma_scale(self) -> Array:
        """What multiplies the sigmas (M, 2), such that correlated sightings together weigh what they are worth."""
        return np.asarray(self.scale * np.sqrt(1 + (self.repeats[:, None] - 1) * self.alike))


def graph_of(log: LogSightings, landmark_rows: Ints, noise: LogNoise) -> Graph:
    """The log's factors; `landmark_rows` (M,) says where each sighting's landmark stands in the state."""
    scale = noise.sigma_scale()[: len(log.pose)]
    covariance = log.covariance * scale[:, :, None] * scale[:, None, :]
    # Heading first: its whitened residual is then the motion's first and alone.
    motion = motion_covariance(log.motions, noise.odometry)[:, [2, 0, 1]][:, :, [2, 0, 1]]
    return Graph(
        seen_pose=log.pose,
        seen_landmark=landmark_rows,
        range_m=log.range_m,
        bearing_rad=log.bearing_rad,
        seen_root=_root(covariance),
        motion_pose=np.arange(len(log) - 1),
        motion=log.motions.relative,
        motion_root=_root(motion)[:, :, [1, 2, 0]],
        prior_landmark=np.empty(0, dtype=np.int64),
        prior_xy=np.empty((0, 2)),
        prior_root=np.empty((0, 2, 2)),
    )


def solve_alone(log: LogSightings, noise: LogNoise, config: BuildMapConfig) -> tuple[Ints, Solved]:
    """Landmark numbers (L,) of a log and the minimum of its graph, in the frame of its odometry.

    Grows from the first poses on: each stretch starts by dead reckoning from what is already solved, so drift never
    adds up over the whole log.
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
        seen_rows = rows[: len(part.pose)]
        landmarks = vote(part.points_xy(poses), part.variance(), seen_rows, landmarks, config.robust_dof)
        known = np.isfinite(landmarks[:, 0])
        compact = np.cumsum(known) - 1
        graph = graph_of(part, compact[seen_rows], noise)
        whole = size == len(log)
        iterations = config.max_iterations if whole else _ROUGHLY
        solved = minimise(graph, State(poses, landmarks[known]), config.robust_dof, iterations)
        if whole:
            return numbers, solved
        poses = solved.state.poses
        landmarks[known] = solved.state.landmarks_xy
        size = min(int(size * _GROWTH), len(log))


def vote(points_xy: Array, variance: Array, rows: Ints, landmarks: Array, robust_dof: float) -> Array:
    """Landmarks (L, 2) moved to one of their sightings, if the rest of them agree better with that.

    points_xy (M, 2) are the sightings as the poses have them, with variance (M,), of the landmarks `rows` (M,). A
    landmark not known yet is NaN; one without sightings stays. Some of each are tried, spread evenly, so that no
    misreading decides.
    """
    out = landmarks.copy()
    order = np.argsort(rows, kind="stable")
    bounds = np.searchsorted(rows[order], np.arange(len(landmarks) + 1))
    for i, (start, end) in enumerate(pairwise(bounds)):
        if start == end:
            continue
        seen = order[start:end]
        tried = points_xy[seen[np.linspace(0, len(seen) - 1, min(len(seen), _CANDIDATES)).astype(np.int64)]]
        if np.isfinite(landmarks[i, 0]):
            tried = np.concatenate([landmarks[i][None], tried])
        squared = ((tried[:, None] - points_xy[None, seen]) ** 2).sum(axis=2) / variance[seen]
        out[i] = tried[np.argmin(student_loss(squared, robust_dof).sum(axis=1))]
    return out


def _root(covariance: Array) -> Array:
    """Lower triangular matrices that whiten residuals of these covariances."""
    return np.linalg.inv(np.linalg.cholesky(covariance))
