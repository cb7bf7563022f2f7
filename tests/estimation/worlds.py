"""Made-up robots that see landmarks by range and bearing, and the bound on what can be told from that."""

from typing import NamedTuple

import numpy as np
from mcap_landmarks.geometry.angles import wrap
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Snapshots(NamedTuple):
    """B true poses (B, 3), the K landmarks that each sees (B, K, 2), and the noisy ranges and bearings (B, K)."""

    poses: Array
    landmarks_xy: Array
    range_m: Array
    bearing_rad: Array
    covariance: Array

    @property
    def true_range_m(self) -> Array:
        return np.asarray(np.linalg.norm(self.landmarks_xy - self.poses[:, None, :2], axis=-1))

    def crb(self) -> Array:
        """Cramer-Rao bounds (B, 3, 3) at the true poses, for normal noise that is independent in range and bearing."""
        d = self.landmarks_xy - self.poses[:, None, :2]
        r = self.true_range_m
        zero, one = np.zeros_like(r), np.ones_like(r)
        jacobian = np.stack(
            [
                np.stack([-d[..., 0] / r, -d[..., 1] / r, zero], axis=-1),
                np.stack([d[..., 1] / r**2, -d[..., 0] / r**2, -one], axis=-1),
            ],
            axis=-2,
        )
        information = np.linalg.inv(np.broadcast_to(self.covariance, (*r.shape, 2, 2)))
        return np.linalg.inv(np.einsum("bkij,bkil,bklm->bjm", jacobian, information, jacobian))


def thesis_like(count: int, seen: int, sigma_range_m: float, sigma_bearing_rad: float, seed: int) -> Snapshots:
    """Landmarks 5.7 to 14.8 m away, up to 28 degrees aside as in Appendix C, at least a metre from each other."""
    rng = np.random.default_rng(seed)
    poses = np.concatenate([rng.uniform(-20, 20, (count, 2)), rng.uniform(-np.pi, np.pi, (count, 1))], axis=1)
    polar = np.empty((count, seen, 2))
    todo = np.arange(count)
    while len(todo):
        polar[todo] = rng.uniform([5.7, np.radians(-28)], [14.8, np.radians(28)], (len(todo), seen, 2))
        r, b = polar[todo, :, 0], polar[todo, :, 1]
        points = r * np.exp(1j * b)
        gaps = np.abs(points[:, :, None] - points[:, None, :]) + 1e9 * np.eye(seen)
        todo = todo[gaps.min(axis=(1, 2)) < 1]
    angle = polar[..., 1] + poses[:, 2:]
    landmarks = poses[:, None, :2] + polar[..., :1] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    noise = rng.normal(size=polar.shape) * [sigma_range_m, sigma_bearing_rad]
    noisy = polar + noise
    covariance = np.diag([sigma_range_m**2, sigma_bearing_rad**2])
    return Snapshots(poses, landmarks, noisy[..., 0], noisy[..., 1], covariance)


def pose_errors(estimate: Array, truth: Array) -> Array:
    """Differences (B, 3) with the heading's brought to [-pi, pi)."""
    error = estimate - truth
    error[:, 2] = wrap(error[:, 2])
    return error


def nees(errors: Array, covariance: Array) -> float:
    """Mean normalised squared error over its dimension: 1 if the covariance is honest."""
    return float(np.einsum("bi,bij,bj->b", errors, np.linalg.inv(covariance), errors).mean() / errors.shape[1])
