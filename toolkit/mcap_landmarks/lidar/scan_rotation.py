"""How far a LiDAR turned between two scans, by matching their ranges beam by beam."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array

_FASTEST_RADPS = 4.0
"""Wheeled robots turn more slowly."""
_MOST_RAD = 1.2
_SLACK_RAD = 0.1
_FINEST_RAD = math.radians(0.5)
"""Finer scans are thinned: beams closer together see the same and cost time."""
_UNLIKE = 0.1
"""Ranges that differ by more than a tenth are of different things; a robot's own motion changes them by less."""
_NONE = 99.0
_HALF = 0.5
_LEAST_BEAMS = 30
_CLEAR = 0.7
"""The best turn is taken where it leaves less than this share of what turns leave on the median."""


@dataclass(frozen=True, slots=True)
class ScanTurn:
    """A turn to the left, from a share of the first scan's sweep to a share of the second's: when what tells it was
    seen.
    """

    turned_rad: float
    first: float
    second: float


def turn_between(first: Array, second: Array, angles_rad: Array, moved_xy: Array, seconds: float) -> ScanTurn | None:
    """How far the LiDAR turned from the first to the second scan, `seconds` later; None if that is unclear.

    Scans are ranges (N,) in m of beams at evenly spaced angles (N,), not finite where nothing came back; `moved_xy`
    (2,) is how far the LiDAR went meanwhile in the first scan's frame, as far as that is known: the first scan is
    projected to there. Every turn that a robot can make in the time is tried, in whole beams: the sum of absolute
    differences of log ranges, cut off at what is another thing, over the beams that both scans have (a full circle goes
    round). A parabola through the best three gives the part of a beam. The cut makes it robust against what moves. This
    is the orientation step of polar scan matching (Diosi and Kleeman 2005).
    """
    step_rad = float(angles_rad[1] - angles_rad[0]) if len(angles_rad) > 1 else 0.0
    if len(first) < _LEAST_BEAMS or len(second) != len(first) or not 0 < abs(step_rad) < 1:
        return None
    thinned = slice(None, None, max(math.floor(_FINEST_RAD / abs(step_rad)), 1))
    beam_rad = step_rad * (thinned.step or 1)
    one, other = _logs(_projected(first[thinned], angles_rad[thinned], moved_xy)), _logs(second[thinned])
    most = math.ceil(min(_FASTEST_RADPS * seconds + _SLACK_RAD, _MOST_RAD) / abs(beam_rad))
    is_circle = abs(abs(step_rad) * len(first) - 2 * math.pi) < 2 * abs(step_rad)
    places, inside = _pairs(len(one), min(most, len(one) // 2 - 1), is_circle)
    apart = np.where(inside, np.minimum(np.abs(one[places] - other), _UNLIKE), 0.0)
    cost = apart.sum(axis=1) / inside.sum(axis=1)
    best = int(np.argmin(cost))
    if best in (0, len(cost) - 1) or not cost[best] < _CLEAR * float(np.median(cost)):
        return None
    left, middle, right = cost[best - 1 : best + 2]
    telling = np.maximum(apart[best - 1] - 2 * apart[best] + apart[best + 1], 0.0)
    if not left - 2 * middle + right > 0:
        return None
    turned = best - len(cost) // 2 + 0.5 * (left - right) / (left - 2 * middle + right)
    shares = np.stack([places[best], np.arange(len(one))]) @ telling / (len(one) * telling.sum())
    return ScanTurn(float(turned * beam_rad), float(shares[0]), float(shares[1]))


@lru_cache(maxsize=32)
def _pairs(count: int, most: int, is_circle: bool) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """For each turn (S,) by up to so many beams, which beam of the first scan each of the second (N,) is, and whether
    there is one.
    """
    places = np.arange(count) + np.arange(-most, most + 1)[:, None]
    inside: NDArray[np.bool_] = (places >= 0) & (places < count) | is_circle
    return places % count, inside


def _projected(ranges_m: Array, angles_rad: Array, moved_xy: Array) -> Array:
    """The ranges (N,) that a scan would have from elsewhere: between beams of one surface they are interpolated.

    At an edge the nearer surface ends half a beam beyond its last beam.
    """
    returned = np.isfinite(ranges_m) & (ranges_m > 0)
    if not returned.any() or not moved_xy.any():
        return ranges_m
    known_m = np.where(returned, ranges_m, 1.0)
    x, y = known_m * np.cos(angles_rad) - moved_xy[0], known_m * np.sin(angles_rad) - moved_xy[1]
    shifted = wrap(np.arctan2(y, x) - angles_rad) / (angles_rad[1] - angles_rad[0])
    beams = np.arange(len(ranges_m), dtype=np.float64)
    shifted = np.interp(beams, beams[returned], shifted[returned])  # what sees nothing moves with what is beside it
    order = np.argsort(beams + shifted)
    at, far = (beams + shifted)[order], np.where(returned, np.hypot(x, y), np.inf)[order]
    right = np.clip(np.searchsorted(at, beams), 1, len(at) - 1)
    low, high = far[right - 1], far[right]
    after = beams - at[right - 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(after / (at[right] - at[right - 1]), 0.0, 1.0)
        is_one = np.abs(low - high) < _UNLIKE * np.minimum(low, high)
        between = low + share * (high - low)
    edge = np.where(low < high, np.where(after <= _HALF, low, high), np.where(at[right] - beams <= _HALF, high, low))
    return np.where(is_one, between, edge)


def _logs(ranges_m: Array) -> Array:
    """Logarithms of ranges; where nothing came back, a value that is like itself only."""
    returned = np.isfinite(ranges_m) & (ranges_m > 0)
    return np.log(ranges_m, out=np.full(len(ranges_m), _NONE), where=returned)
