"""Clouds of a simulated LiDAR with rings, on ground that slopes, among upright boxes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mcap_landmarks.geometry.se2 import Array

LIDAR_M = 1.73
NOISE_M = 0.02


@dataclass(frozen=True, slots=True)
class Solid:
    """An upright box on the ground, or `above_m` it: where its middle is, its size, and the yaw of its length."""

    x: float
    y: float
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float = 0.0
    above_m: float = 0.0


def rays(azimuths_deg: Array, elevations_deg: Array) -> Array:
    """Unit vectors (N, 3) of rings of beams."""
    azimuth, elevation = (part.ravel() for part in np.meshgrid(np.deg2rad(azimuths_deg), np.deg2rad(elevations_deg)))
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)


AHEAD = rays(np.arange(-60.0, 60.0, 0.2), np.arange(-25.0, 3.0, 0.42))
ALL_AROUND = rays(np.arange(-180.0, 180.0, 0.4), np.arange(-25.0, 3.0, 0.42))
SIXTEEN = rays(np.arange(-60.0, 60.0, 0.2), np.arange(-15.0, 16.0, 2.0))


def cloud(
    solids: Sequence[Solid], directions: Array = AHEAD, slope: tuple[float, float] = (0.0, 0.0), seed: int = 0
) -> tuple[Array, Array]:
    """Points (N, 3) in the base frame, and what each is of: the number of a solid, -1 the ground."""
    normal = np.array([-slope[0], -slope[1], 1.0])
    start = np.array([0.0, 0.0, LIDAR_M])
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.where(directions @ normal < 0, -(normal @ start) / (directions @ normal), np.inf)
        owner = np.full(len(directions), -1)
        for i, solid in enumerate(solids):
            distance = _into(solid, start, directions, slope)
            nearer = distance < ranges
            ranges, owner = np.where(nearer, distance, ranges), np.where(nearer, i, owner)
    seen = ranges < 80.0
    noisy = ranges[seen] + np.random.default_rng(seed).normal(0.0, NOISE_M, np.count_nonzero(seen))
    return start + noisy[:, None] * directions[seen], owner[seen]


def _into(solid: Solid, start: Array, directions: Array, slope: tuple[float, float]) -> Array:
    """How far (N,) rays get until they meet a solid."""
    c, s = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    foot = slope[0] * solid.x + slope[1] * solid.y + solid.above_m
    local = turn @ (start - [solid.x, solid.y, foot + solid.height_m / 2])
    half = np.array([solid.length_m, solid.width_m, solid.height_m]) / 2
    ahead = directions @ turn.T
    one, other = (-half - local) / ahead, (half - local) / ahead
    enter, leave = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)
