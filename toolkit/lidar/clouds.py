"""A slice of a point cloud as the beams of a planar LiDAR."""

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array, transform_points
from toolkit.lidar.beams import Beams, Limits, sweep


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

    There is one beam per `beam_rad` around the LiDAR's place `origin_xy` (2,): towards the nearest of its points, or
    ahead through its middle where it has none. `base_from_then` (N, 3) says where the base was at the time of each
    point, in the base frame of the moment that is asked for; a beam without a point leaves from where the one beside
    it does.
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
    all_ranges = np.full(count, np.inf)
    all_angles = (np.arange(count, dtype=np.float64) + 0.5) * (2 * np.pi / count) - np.pi
    all_ranges[bins[first]], all_angles[bins[first]] = ranges[first], angles[first]
    # The place where each beam begins stands for the mounting, which differs from beam to beam.
    places = np.zeros((count, 3))
    places[:, :2] = origins[first[_nearest(bins[first], count)]] if len(first) else origin_xy
    return sweep(all_angles, all_ranges, np.eye(4), places, limits)


def _nearest(taken: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Which of the places that are taken (K,), rising, is nearest to each of `count` around a circle."""
    places = np.arange(count)
    after = np.searchsorted(taken, places)
    ahead = (taken[after % len(taken)] - places) % count
    behind = (places - taken[after - 1]) % count
    return np.where(ahead <= behind, after % len(taken), after - 1)
