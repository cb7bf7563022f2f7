"""A slice of a point cloud as the beams of a planar LiDAR."""

import numpy as np

from toolkit.geometry.se2 import Array
from toolkit.lidar.beams import Beams, Limits, sweep


def slice_cloud(
    points_m: Array, origin_xy: Array, heights_m: tuple[float, float], beam_rad: float, limits: Limits | None = None
) -> Beams:
    """The nearest return in each direction, of the points (N, 3) in the base frame between two heights.

    There is one beam per `beam_rad` around the LiDAR's place `origin_xy` (2,): towards the nearest of its points, or
    ahead through its middle where it has none.
    """
    with np.errstate(invalid="ignore"):
        inside = np.isfinite(points_m).all(axis=1) & (points_m[:, 2] >= heights_m[0]) & (points_m[:, 2] <= heights_m[1])
    away = points_m[inside, :2] - origin_xy
    ranges, angles = np.hypot(away[:, 0], away[:, 1]), np.arctan2(away[:, 1], away[:, 0])
    if limits is not None:
        near = (ranges >= limits.range_m[0]) & (ranges <= limits.range_m[1])
        ranges, angles = ranges[near], angles[near]
    count = max(round(2 * np.pi / beam_rad), 1)
    bins = np.minimum(((angles + np.pi) * (count / (2 * np.pi))).astype(np.int64), count - 1)
    order = np.lexsort((ranges, bins))
    first = order[np.unique(bins[order], return_index=True)[1]]
    all_ranges = np.full(count, np.inf)
    all_angles = (np.arange(count, dtype=np.float64) + 0.5) * (2 * np.pi / count) - np.pi
    all_ranges[bins[first]], all_angles[bins[first]] = ranges[first], angles[first]
    mounted = np.eye(4)
    mounted[:2, 3] = origin_xy
    return sweep(all_angles, all_ranges, mounted, limits=limits)
