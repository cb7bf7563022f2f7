"""One log's part of the factor graph: what was observed, how noisy that is, and the factors of both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import Graph
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry import se2

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class LandmarkObservations:
    """What one log saw: N poses with motions between them from `start` (3,) on, M observations from pose `pose` (M,).

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

    def first(self, poses: int) -> "LandmarkObservations":
        """The part of the log up to some number of poses."""
        m, seen = self.motions, slice(0, int(np.searchsorted(self.pose, poses)))
        part = slice(0, poses - 1)
        return LandmarkObservations(
            self.start,
            Motions(m.relative[part], m.distance_m[part], m.turn_rad[part]),
            self.pose[seen],
            self.landmark[seen],
            self.range_m[seen],
            self.bearing_rad[seen],
            self.covariance[seen],
        )

    def points_xy(self, poses: Array) -> Array:
        """Where the observed points (M, 2) lie if the log's poses are these."""
        local = self.range_m[:, None] * np.stack([np.cos(self.bearing_rad), np.sin(self.bearing_rad)], axis=-1)
        return se2.transform_points(poses[self.pose], local)

    def variance(self) -> Array:
        """Variance (M,) of the observed points, in all directions together."""
        return np.asarray(self.covariance[:, 0, 0] + self.range_m**2 * self.covariance[:, 1, 1])


@dataclass(frozen=True, slots=True)
class LogNoise:
    """Noise of a log: its odometry's, what multiplies the sigmas of range and bearing (2,), what observations share.

    `alike` (2,) is the correlation of the errors of ranges and of bearings to one landmark from one place, `repeats`
    (M,) how many observations each observation's place has.
    """

    odometry: OdometryNoise
    scale: Array
    alike: Array
    repeats: Ints

    def sigma_scale(self) -> Array:
        """What multiplies the sigmas (M, 2), such that correlated observations together weigh what they are worth.

        The mean of k errors with correlation c has the variance (1 + (k - 1) c) / k (design effect, Kish 1965).
        """
        return np.asarray(self.scale * np.sqrt(1 + (self.repeats[:, None] - 1) * self.alike))


def graph_of(log: LandmarkObservations, landmark_rows: Ints, noise: LogNoise) -> Graph:
    """The log's factors; `landmark_rows` (M,) says where each observation's landmark stands in the state."""
    scale = noise.sigma_scale()[: len(log.pose)]
    covariance = log.covariance * scale[:, :, None] * scale[:, None, :]
    # Heading first: its whitened residual is then the motion's first and alone.
    motion = motion_covariance(log.motions, noise.odometry)[:, [2, 0, 1]][:, :, [2, 0, 1]]
    return Graph(
        observation_pose=log.pose,
        observation_landmark=landmark_rows,
        range_m=log.range_m,
        bearing_rad=log.bearing_rad,
        observation_root=_root(covariance),
        motion_pose=np.arange(len(log) - 1),
        motion=log.motions.relative,
        motion_root=_root(motion)[:, :, [1, 2, 0]],
        prior_landmark=np.empty(0, dtype=np.int64),
        prior_xy=np.empty((0, 2)),
        prior_root=np.empty((0, 2, 2)),
    )


def _root(covariance: Array) -> Array:
    """Lower triangular matrices that whiten residuals of these covariances."""
    return np.linalg.inv(np.linalg.cholesky(covariance))
