"""A slice of a point cloud as the beams of a planar LiDAR."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.lidar.beams import Beams, Limits, sweep

_ON_ONE_M, _WIDEST_RAD = 0.5, 0.1
"""Neighbours so near to each other are on one thing, and tell how far apart beams are."""


def in_slice(points_m: Array, heights_m: tuple[float, float]) -> NDArray[np.bool_]:
    """Which of the points (N, 3) in the base frame lie between two heights."""
    with np.errstate(invalid="ignore"):
        between = (points_m[:, 2] >= heights_m[0]) & (points_m[:, 2] <= heights_m[1])
    return np.isfinite(points_m).all(axis=1) & between


def slice_beams(
    points_xy: Array,
    origin_xy: Array,
    beam_rad: float,
    base_from_then: Array | None = None,
    limits: Limits | None = None,
) -> Beams:
    """The nearest return in each direction, of the points (N, 2) of a slice in the base frame.

    Of the points in each `beam_rad` around the LiDAR's place `origin_xy` (2,) the nearest is where a beam ended. In
    between are beams that met nothing, as far apart as the cloud's own: what a sparse one leaves out need not be free.
    `base_from_then` (N, 3) says where the base was at the time of each point, in the base frame of the moment that is
    asked for; a beam without a point leaves from where the one beside it does.
    """
    origins = np.broadcast_to(origin_xy, points_xy.shape)
    if base_from_then is not None:
        points_xy, origins = transform_points(base_from_then, points_xy), transform_points(base_from_then, origins)
    away = points_xy - origins
    ranges, angles = np.hypot(away[:, 0], away[:, 1]), np.arctan2(away[:, 1], away[:, 0])
    if limits is not None:
        near = (ranges >= limits.range_m[0]) & (ranges <= limits.range_m[1])
        ranges, angles, origins = ranges[near], angles[near], origins[near]
    count = max(round(2 * np.pi / beam_rad), 1)
    bins = np.minimum(((angles + np.pi) * (count / (2 * np.pi))).astype(np.int64), count - 1)
    order = np.lexsort((ranges, bins))
    first = order[np.unique(bins[order], return_index=True)[1]]
    if not len(first):
        angles = (np.arange(count, dtype=np.float64) + 0.5) * (2 * np.pi / count) - np.pi
        return sweep(angles, np.full(count, np.inf), np.eye(4), _places(np.broadcast_to(origin_xy, (count, 2))), limits)
    ranges, angles, origins = ranges[first], angles[first], origins[first]
    free, beside = _free(ranges, angles, beam_rad)
    all_angles = np.concatenate([angles, free])
    all_ranges = np.concatenate([ranges, np.full(len(free), np.inf)])
    places = _places(np.concatenate([origins, origins[beside]]))
    return sweep(all_angles, all_ranges, np.eye(4), places, limits)


def _places(origins_xy: Array) -> Array:
    """Where beams begin as places of the base (N, 3): they stand for the mounting, which differs from beam to beam."""
    return np.column_stack([origins_xy, np.zeros(len(origins_xy))])


def _free(ranges: Array, angles: Array, beam_rad: float) -> tuple[Array, NDArray[np.int64]]:
    """Directions (M,) of beams that met nothing between those that ended at K rising angles; which is beside each."""
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    aside = np.hypot(np.roll(ranges, -1) - ranges, gaps * ranges)  # nearly the distance of near points
    on_one = gaps[(aside < _ON_ONE_M) & (gaps < _WIDEST_RAD)]
    usual = max(beam_rad, float(np.median(on_one))) if len(on_one) else beam_rad
    missing = np.maximum(np.round(gaps / usual).astype(np.int64) - 1, 0)
    before = np.repeat(np.arange(len(gaps)), missing)
    step = np.arange(len(before)) - np.repeat(np.cumsum(missing) - missing, missing) + 1
    share = step / (missing[before] + 1)
    beside = np.where(share <= 0.5, before, (before + 1) % len(gaps))
    return wrap(angles[before] + share * gaps[before]), beside
