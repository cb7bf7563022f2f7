"""Small drives through small worlds, as the bundles that stages read."""

from collections.abc import Iterator

import numpy as np
from mcap_landmarks.channels import SCENE_OBJECTS
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.geometry.se2 import Array, between, compose, inverse, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, OdometryAt

CLASSES = ("hydrant", "person", "suitcase")
RANGE_SIGMA_M, BEARING_SIGMA_RAD = 0.02, 0.005


def circle(turns: float = 1.2, radius_m: float = 8.0, count: int = 240) -> Array:
    """Poses (T, 3) once around and a bit more."""
    angle = np.linspace(0, 2 * np.pi * turns, count)
    return np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), angle + np.pi / 2])


def ring(count: int = 15) -> tuple[tuple[str, ...], Array]:
    """Classes that repeat, and positions (N, 2) on an uneven ring."""
    rng = np.random.default_rng(7)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False) + rng.uniform(-0.1, 0.1, count)
    radius = rng.uniform(10, 13, count)
    classes = tuple(CLASSES[i] for i in rng.integers(0, len(CLASSES), count))
    return classes, np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def drifting(poses: Array, rng: np.random.Generator, scale: float = 1.0) -> Array:
    """Odometry (T, 3) of a drive, from the origin on."""
    steps = between(poses[:-1], poses[1:])
    way = np.hypot(steps[:, 0], steps[:, 1])[:, None]
    steps = steps + rng.normal(size=steps.shape) * np.array([0.01, 0.005, 0.003]) * np.sqrt(way) * scale
    odometry = np.zeros_like(poses)
    for i, step in enumerate(steps):
        odometry[i + 1] = compose(odometry[i], step)
    return odometry


def scene(
    pose: Array, classes: tuple[str, ...], positions: Array, rng: np.random.Generator, stamp: int
) -> SceneObjects:
    """What is seen within 7 m."""
    points = transform_points(inverse(pose), positions)
    range_m, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    seen = np.flatnonzero(range_m < 7)
    polar = np.diag([RANGE_SIGMA_M**2, BEARING_SIGMA_RAD**2])
    noise = rng.normal(size=(len(seen), 2)) * [RANGE_SIGMA_M, BEARING_SIGMA_RAD]
    xy, covariances = points_from_polar(range_m[seen] + noise[:, 0], bearing[seen] + noise[:, 1], polar)
    ids = tuple(str(i) for i in range(len(seen)))
    return SceneObjects(
        stamp, "base", ids, tuple(((classes[i], 0.9),) for i in seen), xy, covariances, np.full(len(seen), 0.2)
    )


def drive(
    poses: Array, classes: tuple[str, ...], positions: Array, seed: int, odometry: Array | None = None
) -> Iterator[Bundle]:
    """Bundles at 2 Hz."""
    rng = np.random.default_rng(seed)
    trail = drifting(poses, rng) if odometry is None else odometry
    steps = between(trail[:-1], trail[1:])
    way = np.concatenate([[0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    turned = np.concatenate([[0], np.cumsum(np.abs(steps[:, 2]))])
    for i, pose in enumerate(poses):
        now = i * 500_000_000 + 1
        at = OdometryAt("odom", trail[i], np.zeros((3, 3)), float(way[i]), float(turned[i]))
        yield Bundle(now, now, {SCENE_OBJECTS: scene(pose, classes, positions, rng, now)}, at)
