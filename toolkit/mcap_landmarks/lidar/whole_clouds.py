"""What a whole cloud shows: its points above the ground, the clusters they are in, and a box around each of these."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.lidar.cloud_clusters import BACKGROUND, cloud_clusters
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.ground import Floats, above_ground
from mcap_landmarks.lidar.rectangles import Rectangle, hugging
from mcap_landmarks.messages.points import PointCloud2

BaseFromThen = Callable[[NDArray[np.int64]], Array]
"""Poses (N, 3) of the base at times (N,) in ns, in the base frame at the moment that is asked for."""

_FARTHEST_M = 1e4
"""No LiDAR measures farther; larger coordinates are no returns."""
_LARGEST_M = 20.0
"""Unless it is said otherwise, what is larger is background: the longest buses have 19 m (Directive 96/53/EC)."""


@dataclass(frozen=True, slots=True, eq=False)
class CloudObject:
    """One cluster: its number, the rectangle that hugs it, and the heights of its foot and top in the base frame."""

    cluster: int
    rectangle: Rectangle
    foot_m: float
    top_m: float


@dataclass(frozen=True, slots=True, eq=False)
class WholeCloud:
    """N points above the ground: points_m (N, 3) in the base frame, heights_m (N,) above the local ground, clusters
    (N,), and the objects that these are."""

    points_m: Floats
    heights_m: Floats
    clusters: NDArray[np.int32]
    objects: tuple[CloudObject, ...]


def points_in_base(
    cloud: PointCloud2, stamp_ns: int, base_from_lidar: Array, base_from_then: BaseFromThen | None
) -> Array:
    """The returns (N, 3) of a cloud in the base frame at the moment that is asked for, de-skewed where that is known.

    `base_from_then` says where the base was at times (N,) in ns; `stamp_ns` stands in where the cloud has no stamp.
    """
    x, y, z = np.abs(cloud.points_m.T)
    returned = (x < _FARTHEST_M) & (y < _FARTHEST_M) & (z < _FARTHEST_M)  # what is not a number is not less
    points = frames.apply(base_from_lidar, cloud.points_m[returned])
    if base_from_then is not None and cloud.times_ns is not None and len(points):
        moved = base_from_then((cloud.stamp_ns or stamp_ns) + cloud.times_ns[returned])
        points[:, :2] = transform_points(moved, points[:, :2])
    return points


def whole_cloud(points_m: Array, lidar_xy: Array, config: ClusterConfig) -> WholeCloud:
    """What points (N, 3) in the base frame show, seen by a LiDAR at `lidar_xy` (2,)."""
    away = points_m[:, :2] - lidar_xy
    if config.range_m is not None:
        distance = np.hypot(away[:, 0], away[:, 1])
        inside = (distance >= config.range_m[0]) & (distance <= config.range_m[1])
        points_m, away = points_m[inside], away[inside]
    heights = above_ground(points_m, lidar_xy)
    stands = (heights > config.clearance_m) & (heights < config.tallest_m)
    points, heights, away = points_m[stands].astype(np.float32), heights[stands], away[stands]
    clusters, count = cloud_clusters(away, heights, config.fewest_points)
    known = clusters != BACKGROUND
    points, heights, clusters = points[known], heights[known], clusters[known]
    largest = _LARGEST_M if config.largest_m is None else config.largest_m
    return WholeCloud(points, heights, clusters, _objects(points, heights, clusters, count, largest))


def _objects(
    points_m: Floats, heights_m: Floats, clusters: NDArray[np.int32], count: int, largest_m: float
) -> tuple[CloudObject, ...]:
    """The objects that clusters (N,) from 0 to `count` are, without those that are larger than objects are."""
    if not count:
        return ()
    order = np.argsort(clusters, kind="stable")
    starts = np.searchsorted(clusters[order], np.arange(count + 1))
    points, floors = points_m[order], (points_m[:, 2] - heights_m)[order]
    low, high = np.minimum.reduceat(points, starts[:-1]), np.maximum.reduceat(points, starts[:-1])
    small = np.flatnonzero(np.hypot(*(high - low)[:, :2].T) <= largest_m).tolist()
    owned = {i: slice(starts[i], starts[i + 1]) for i in small}
    rectangles = hugging([points[own, :2] for own in owned.values()])
    return tuple(
        CloudObject(i, rectangle, _median(floors[owned[i]]), float(high[i, 2]))
        for i, rectangle in zip(owned, rectangles, strict=True)
    )


def _median(values: Floats) -> float:
    """The median of values (N,): NumPy's own takes ten times as long for the few that clusters have."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    ordered = np.partition(values, [middle - 1, middle])
    return float((ordered[middle - 1] + ordered[middle]) / np.float32(2))
