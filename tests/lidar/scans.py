"""Scans of discs and boxes by geometry that the toolkit's shapes have no part in."""

from collections.abc import Sequence

import numpy as np
from mcap_landmarks.geometry.se2 import Array, inverse, rotation, transform_points

ANGLES_RAD = np.linspace(0.0, 6.28, 360)
SIGMA_M = 0.01

Thing = tuple[Array, tuple[float, ...]]
"""A pose x, y, heading (3,), and a radius, or a length and a width."""


def disc(x: float, y: float, radius_m: float) -> Thing:
    return np.array([x, y, 0.0]), (radius_m,)


def box(x: float, y: float, heading: float, length_m: float, width_m: float) -> Thing:
    return np.array([x, y, heading]), (length_m, width_m)


def legs(x: float, y: float, heading: float, apart_m: float) -> list[Thing]:
    pose = np.array([x, y, heading])
    places = transform_points(pose, np.array([[0.0, apart_m / 2], [0.0, -apart_m / 2]]))
    return [disc(*place, 0.06) for place in places.tolist()]


def ranges(
    things: Sequence[Thing],
    rng: np.random.Generator | None = None,
    angles: Array = ANGLES_RAD,
    base_from_lidar: Array | None = None,
) -> Array:
    """Distances (N,) along beams at angles, from LiDAR poses (3,) or one per beam (N, 3), inf for nothing."""
    poses = (
        np.zeros((len(angles), 3)) if base_from_lidar is None else np.broadcast_to(base_from_lidar, (len(angles), 3))
    )
    headings = angles + poses[:, 2]
    ahead = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    nearest = np.full(len(angles), np.inf)
    for pose, size in things:
        start, along = transform_points(inverse(pose), poses[:, :2]), ahead @ rotation(pose[2])
        meet = _meet_disc(start, along, *size) if len(size) == 1 else _meet_box(start, along, np.array(size) / 2)
        nearest = np.minimum(nearest, meet)
    return nearest if rng is None else nearest + rng.normal(0.0, SIGMA_M, len(angles))


def _meet_disc(start: Array, along: Array, radius_m: float) -> Array:
    foot = (start * along).sum(axis=1)
    inside = foot**2 - (start**2).sum(axis=1) + radius_m**2
    return np.where((inside >= 0) & (foot < 0), -foot - np.sqrt(np.maximum(inside, 0)), np.inf)


def _meet_box(start: Array, along: Array, half_m: Array) -> Array:
    with np.errstate(divide="ignore"):
        crossings = (np.stack([-half_m, half_m])[:, None] - start) / along
    enter, leave = crossings.min(axis=0).max(axis=1), crossings.max(axis=0).min(axis=1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)
