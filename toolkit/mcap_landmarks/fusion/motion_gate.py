"""Which known objects those of a new scan are: each was where it stood, or is where its motion took it."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.classes import CLASSES, speed_mps
from mcap_landmarks.fusion.track_motion import MOVING, TrackMotion
from mcap_landmarks.geometry.se2 import Array

_NEW_PER_M2 = 1e-3
"""Density of objects that were not seen before: one on 30 m by 30 m."""
_WANDER_M = 0.3
"""How far the middle of an object may wander from scan to scan, as more or less of it is seen."""
_OTHER_CLASS = 0.002
"""How often an object has a class of another kind than before; vehicles are all of one kind here."""


def match(
    known: Sequence[tuple[TrackMotion, str]], stamp_ns: int, seen: tuple[Array, Array], classes: Sequence[str]
) -> dict[int, int]:
    """Which known object (motion, class) each seen one is, as far as it is any.

    `seen` are places (N, 2) and covariances (N, 2, 2) in the odometry frame.

    Each pair is weighed against the place being that of a new object; the sum of these logarithms is the largest.
    """
    if not (known and classes):
        return {}
    gain = np.zeros((len(classes), len(known)))
    for j, (motion, name) in enumerate(known):
        alike = np.array([1.0 if _alike(name, other) else _OTHER_CLASS for other in classes])
        with np.errstate(divide="ignore"):
            gain[:, j] = np.log(alike * _density(motion, name, stamp_ns, *seen) / _NEW_PER_M2)
    rows, columns = linear_sum_assignment(-np.maximum(gain, 0.0))
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if gain[i, j] > 0}


def _alike(one: str, other: str) -> bool:
    return one == other or (_is_vehicle(one) and _is_vehicle(other))


def _is_vehicle(name: str) -> bool:
    return name in CLASSES and CLASSES[name].cuboid is not None


def _density(motion: TrackMotion, name: str, stamp_ns: int, places: Array, covariances: Array) -> Array:
    """How likely an object is to be at places (N, 2), per m^2."""
    last, since_s = motion.last, (stamp_ns - motion.last.stamp_ns) / 1e9
    if motion.moving == 1.0:
        there, unsure = motion.expected(stamp_ns)
        return _normal(places - there, covariances + unsure + _WANDER_M**2 * np.eye(2))
    spread = covariances + last.covariance + _WANDER_M**2 * np.eye(2)
    stands = _normal(places - last.place_xy, spread)
    speed = speed_mps(name)
    if not speed:
        return stands
    drives = _normal(places - last.place_xy, spread + (since_s * speed) ** 2 * np.eye(2))
    return (1 - MOVING) * stands + MOVING * drives


def _normal(off: Array, covariances: Array) -> Array:
    """The density of a normal distribution at (N, 2) from its mean, with covariances (N, 2, 2)."""
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(covariances, off[..., None])[..., 0])
    density: Array = np.exp(-squared / 2) / (2 * np.pi * np.sqrt(np.linalg.det(covariances)))
    return density
