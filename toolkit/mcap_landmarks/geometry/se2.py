"""Rigid transforms of the plane as arrays (..., 3) of x, y, heading; `dst_from_src` by name."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.geometry.angles import wrap

Array = NDArray[np.float64]


def rotation(heading_rad: ArrayLike) -> Array:
    """Rotation matrices (..., 2, 2) of headings (...)."""
    heading = np.asarray(heading_rad, dtype=np.float64)
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def transform_points(dst_from_src: ArrayLike, points_xy: ArrayLike) -> Array:
    """Points (..., 2) of frame src in frame dst; transform (..., 3) and points broadcast."""
    pose = np.asarray(dst_from_src, dtype=np.float64)
    points = np.asarray(points_xy, dtype=np.float64)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0], points[..., 1]
    return np.stack([pose[..., 0] + c * x - s * y, pose[..., 1] + s * x + c * y], axis=-1)


def compose(c_from_b: ArrayLike, b_from_a: ArrayLike) -> Array:
    """c_from_a (..., 3): first `b_from_a`, then `c_from_b`."""
    outer = np.asarray(c_from_b, dtype=np.float64)
    inner = np.asarray(b_from_a, dtype=np.float64)
    xy = transform_points(outer, inner[..., :2])
    return np.concatenate([xy, wrap(outer[..., 2] + inner[..., 2])[..., None]], axis=-1)


def inverse(b_from_a: ArrayLike) -> Array:
    """a_from_b (..., 3)."""
    pose = np.asarray(b_from_a, dtype=np.float64)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = pose[..., 0], pose[..., 1]
    return np.stack([-c * x - s * y, s * x - c * y, wrap(-pose[..., 2])], axis=-1)


def between(world_from_a: ArrayLike, world_from_b: ArrayLike) -> Array:
    """a_from_b (..., 3) of two poses in the same frame."""
    return compose(inverse(world_from_a), world_from_b)


def interpolate(time_ns: NDArray[np.int64], poses: Array, at_ns: NDArray[np.int64]) -> Array:
    """Poses (M, 3) at the times `at_ns` (M,), on the SE(2) geodesic between the neighbours of `poses` (N, 3).

    `time_ns` (N,) rises strictly and spans every asked time.
    """
    right = np.clip(np.searchsorted(time_ns, at_ns, side="left"), 1, len(time_ns) - 1)
    left = right - 1
    share = (at_ns - time_ns[left]) / (time_ns[right] - time_ns[left])
    return compose(poses[left], exp(log(between(poses[left], poses[right])) * share[:, None]))


def exp(twist: ArrayLike) -> Array:
    """Pose (..., 3) reached by the constant twist (..., 3) of forward, left and turn over unit time."""
    v = np.asarray(twist, dtype=np.float64)
    half = v[..., 2] / 2
    chord = np.sinc(half / np.pi)
    c, s = np.cos(half) * chord, np.sin(half) * chord
    return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1], wrap(v[..., 2])], axis=-1)


def log(pose: ArrayLike) -> Array:
    """Twist (..., 3) whose `exp` is the pose (..., 3); turns stay within half a circle."""
    p = np.asarray(pose, dtype=np.float64)
    turn = wrap(p[..., 2])
    half = turn / 2
    chord = np.sinc(half / np.pi)
    c, s = np.cos(half) / chord, np.sin(half) / chord
    return np.stack([c * p[..., 0] + s * p[..., 1], -s * p[..., 0] + c * p[..., 1], turn], axis=-1)
