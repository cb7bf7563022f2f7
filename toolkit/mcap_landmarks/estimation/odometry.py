"""Motions between bundles from odometry, and how far they can be trusted."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import between, log

Array = NDArray[np.float64]

# Standing still is never known better than this (m, rad); it adds up over all bundles while a robot stands.
_FLOOR_M, _FLOOR_RAD = 1e-5, 1e-5
# Wheels roll further off than they slip: variance sideways over variance forwards. The map of MRCLAM's robot 3 is
# 0.107 m wrong; 0.05 and 1 change that by 2 mm.
_SIDEWAYS = 0.25


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Random walk of odometry: standard deviations after one metre of way or one radian of turning.

    The defaults suit a small wheeled robot of unknown quality; mapping estimates the log's own from there.
    """

    position_per_metre_m: float = 0.05
    heading_per_metre_rad: float = 0.05
    heading_per_radian_rad: float = 0.1


@dataclass(frozen=True, slots=True)
class Motions:
    """N - 1 motions between N moments: `relative` (N-1, 3) in the frame of the earlier pose, and the way between."""

    relative: Array
    distance_m: Array
    turn_rad: Array


def motion_covariance(motions: Motions, noise: OdometryNoise) -> Array:
    """Covariances (N-1, 3, 3) of the relative motions.

    Heading errs evenly along the way, so position errs with it across the chord: a third of its variance, half its
    covariance (integrals of a random walk).
    """
    way = motions.distance_m
    heading = noise.heading_per_metre_rad**2 * way + noise.heading_per_radian_rad**2 * motions.turn_rad + _FLOOR_RAD**2
    position = noise.position_per_metre_m**2 * way + _FLOOR_M**2
    across = np.stack([-motions.relative[:, 1], motions.relative[:, 0]], axis=-1)
    length = np.maximum(np.hypot(across[:, 0], across[:, 1]), 1e-12)
    # Position errs by the whole variance along the chord and by a part of it across, which the heading adds to.
    less = heading / 3 - (1 - _SIDEWAYS) * position / length**2
    out = np.zeros((len(way), 3, 3))
    out[:, :2, :2] = position[:, None, None] * np.eye(2) + less[:, None, None] * across[:, :, None] * across[:, None]
    out[:, :2, 2] = out[:, 2, :2] = (heading / 2)[:, None] * across
    out[:, 2, 2] = heading
    return out


def random_walk(stamps_ns: NDArray[np.int64], odom_from_base: Array) -> Array:
    """How odometry jumps about between its messages: covariance (3, 3) of its twists in a second, in m^2, m rad, rad^2.

    `odom_from_base` (K, 3) are the poses at K rising stamps (K,). A robot's velocity changes evenly over three steps;
    what second differences of the velocities leave of them is taken for noise that is new in each step. Of fewer than
    four poses nothing is known, and it is zero.
    """
    if len(stamps_ns) < 4:
        return np.zeros((3, 3))
    steps_s = np.diff(stamps_ns) / 1e9
    velocities = log(between(odom_from_base[:-1], odom_from_base[1:])) / steps_s[:, None]
    bent = velocities[2:] - 2 * velocities[1:-1] + velocities[:-2]
    # A walk of variance q in a second makes the mean velocity over t vary by q / t.
    bent /= np.sqrt(1 / steps_s[2:] + 4 / steps_s[1:-1] + 1 / steps_s[:-2])[:, None]
    found: Array = bent.T @ bent / len(bent)
    return found


def dead_reckoning(start: Array, motions: Motions) -> Array:
    """Poses (N, 3) that follow `start` (3,) by the motions."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(motions.relative[:, 2])])
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    x, y = motions.relative[:, 0], motions.relative[:, 1]
    steps = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    xy = start[:2] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.concatenate([xy, wrap(heading)[:, None]], axis=1)
