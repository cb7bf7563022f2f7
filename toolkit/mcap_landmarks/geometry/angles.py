"""Angles in radians and quaternions about the vertical axis."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrap(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Bring angles of any shape into [-pi, pi)."""
    return (np.asarray(angle_rad, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi


def yaw_from_quaternion(quaternion_xyzw: ArrayLike) -> NDArray[np.float64]:
    """Rotation about z (...,) of quaternions (..., 4), which need not be normalised."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion_xyzw, dtype=np.float64), -1, 0)
    yaw: NDArray[np.float64] = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw


def quaternion_from_yaw(yaw_rad: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (..., 4) in the order x, y, z, w of rotations about z."""
    half = np.asarray(yaw_rad, dtype=np.float64) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)
