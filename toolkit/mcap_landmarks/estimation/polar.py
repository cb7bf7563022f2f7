"""Observed objects as points or as range and bearing in the base frame, with their covariance."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def polar_from_points(points_xy: ArrayLike, covariance: ArrayLike) -> tuple[Array, Array, Array]:
    """Range (...), bearing (...) and their covariance (..., 2, 2) of points (..., 2) with such covariance in m^2.

    To first order. A point at the base itself has no bearing: its covariance is not a number, so solvers leave it out.
    """
    points = np.asarray(points_xy, dtype=np.float64)
    x, y = points[..., 0], points[..., 1]
    range_m = np.hypot(x, y)
    safe = np.where(range_m > 0, range_m, np.nan)
    jacobian = _matrix(x / safe, y / safe, -y / safe**2, x / safe**2)
    return range_m, np.arctan2(y, x), _propagate(jacobian, covariance)


def points_from_polar(range_m: ArrayLike, bearing_rad: ArrayLike, covariance: ArrayLike) -> tuple[Array, Array]:
    """Points (..., 2) and their covariance (..., 2, 2) in m^2 of ranges and bearings (...) with such covariance."""
    distance, bearing = np.asarray(range_m, dtype=np.float64), np.asarray(bearing_rad, dtype=np.float64)
    c, s = np.cos(bearing), np.sin(bearing)
    points = np.stack([distance * c, distance * s], axis=-1)
    return points, _propagate(_matrix(c, -distance * s, s, distance * c), covariance)


def _matrix(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Matrices (..., 2, 2) of rows (a, b) and (c, d)."""
    return np.stack([np.stack([a, b], axis=-1), np.stack([c, d], axis=-1)], axis=-2)


def _propagate(jacobian: Array, covariance: ArrayLike) -> Array:
    result = jacobian @ np.asarray(covariance, dtype=np.float64) @ jacobian.swapaxes(-1, -2)
    return (result + result.swapaxes(-1, -2)) / 2
