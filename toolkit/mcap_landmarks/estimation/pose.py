"""Poses from ranges and bearings to known landmarks."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.estimation.pose_batch import PoseSolutions, solve_batch
from mcap_landmarks.estimation.problems import Problems

Array = NDArray[np.float64]


def solve_poses(
    landmarks_xy: ArrayLike,
    range_m: ArrayLike,
    bearing_rad: ArrayLike,
    covariance: ArrayLike,
    *,
    landmark_covariance: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    robust_dof: float | None = None,
    max_iterations: int = 30,
) -> PoseSolutions:
    """Poses that explain ranges and bearings (B, K), seen in the base frame, to landmarks (B, K, 2) in the map frame.

    `covariance` (B, K, 2, 2) is that of (range, bearing), in m^2, m rad and rad^2, `landmark_covariance` (B, K, 2, 2)
    the map's own; all broadcast. `mask` (B, K) says which observations exist; those that are not finite, or whose
    covariance is not positive definite, don't. Two or more are needed for a pose. With `robust_dof`, observations weigh
    as under a Student-t distribution of so many degrees. From weighted Procrustes on by Levenberg-Marquardt
    (Marquardt 1963).
    """
    given = Problems.of(landmarks_xy, range_m, bearing_rad, covariance, landmark_covariance, mask)
    count, width = given.range_m.shape
    return solve_batch(given.prepare, count, width, numbers=2, robust_dof=robust_dof, max_iterations=max_iterations)


def position_sigma(covariance: ArrayLike) -> Array:
    """Largest standard deviation of the position in any direction, (...) in m, of pose covariances (..., 3, 3)."""
    matrix = np.asarray(covariance, dtype=np.float64)
    xx, yy, xy = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    with np.errstate(invalid="ignore"):
        largest = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    return np.sqrt(np.where(np.isinf(xx) | np.isinf(yy), np.inf, largest))
