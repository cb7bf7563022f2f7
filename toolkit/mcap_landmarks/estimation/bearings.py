"""Poses from bearings to known landmarks alone."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.estimation.linearise import Observations, Poses
from mcap_landmarks.estimation.pose_batch import PoseSolutions, solve_batch

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


def solve_bearings(
    landmarks_xy: ArrayLike,
    bearing_rad: ArrayLike,
    variance: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    max_iterations: int = 30,
) -> PoseSolutions:
    """Poses that explain bearings (B, K) with variance (B, K) in rad^2 to three or more landmarks (B, K, 2).

    From the linear solution on by Levenberg-Marquardt. A robot on one circle with all its landmarks has no pose: its
    covariance is infinite, or large nearby. `mask` and everything else as in `pose.solve_poses`.
    """
    bearings = np.asarray(bearing_rad, dtype=np.float64)
    landmarks = np.broadcast_to(np.asarray(landmarks_xy, dtype=np.float64), (*bearings.shape, 2))
    noise = np.broadcast_to(np.asarray(variance, dtype=np.float64), bearings.shape)
    exists = np.broadcast_to(np.asarray(True if mask is None else mask, dtype=np.bool_), bearings.shape)

    def prepare(part: slice | NDArray[np.int64]) -> tuple[Observations, Poses, Bools]:
        x, y, bearing, spread = (
            a.T for a in (landmarks[part, :, 0], landmarks[part, :, 1], bearings[part], noise[part])
        )
        used = exists[part].T & np.isfinite(x + y + bearing) & (spread > 0) & (spread < np.inf)
        x, y, bearing = (np.where(used, a, 0.0) for a in (x, y, bearing))
        weight = np.where(used, 1 / np.where(used, spread, 1.0), 0.0)
        zero = np.zeros_like(x)
        observed = Observations(x, y, zero, np.cos(bearing), np.sin(bearing), zero, zero, weight)
        return observed, _linear(observed, used), used

    return solve_batch(prepare, *bearings.shape, numbers=1, robust_dof=None, max_iterations=max_iterations)


def _linear(observed: Observations, used: Bools) -> Poses:
    """Poses whose lines of sight pass landmarks closest, by an algebraic distance (direct linear transform).

    With the position in the base frame as unknown, every bearing is linear in cosine, sine and position; they are the
    eigenvector of least eigenvalue. Landmarks are centred and scaled first (Hartley 1997).
    """
    count = np.maximum(used.sum(axis=0), 1)
    middle_x = (observed.landmark_x * used).sum(axis=0) / count
    middle_y = (observed.landmark_y * used).sum(axis=0) / count
    x, y = (observed.landmark_x - middle_x) * used, (observed.landmark_y - middle_y) * used
    size = np.sqrt((x * x + y * y).sum(axis=0) / count)
    size = np.where(size > 0, size, 1.0)
    x, y, ux, uy = x / size, y / size, observed.direction_x * used, observed.direction_y * used
    rows = np.stack([ux * y - uy * x, -ux * x - uy * y, uy, -ux], axis=-1)
    _, vectors = np.linalg.eigh(np.einsum("kbi,kbj->bij", rows, rows))
    c, s, tx, ty = vectors[:, :, 0].T
    norm = np.hypot(c, s)
    norm = np.where(norm > 1e-12, norm, 1.0)
    c, s, tx, ty = c / norm, s / norm, tx / norm, ty / norm
    ahead = (ux * (c * x + s * y - tx) + uy * (c * y - s * x - ty)).sum(axis=0)
    sign = np.where(ahead < 0, -1.0, 1.0)
    c, s = c * sign, s * sign
    px, py = c * tx * sign - s * ty * sign, s * tx * sign + c * ty * sign
    known = c * c + s * s > 0.5
    return Poses(middle_x + size * px, middle_y + size * py, np.where(known, c, 1.0), np.where(known, s, 0.0))
