"""Algorithm 2 of the thesis: what of a scan lies in the camera's view, and the middle beam of each object."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import echoes
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects

VIEW_DEG = 30.0
RANGE_M = (0.5, 15.0)


def scan_objects(scan: LaserScan, stamp_ns: int, base: str, base_from_lidar: Array) -> tuple[LaserScan, ScanObjects]:
    """The filtered scan, and the near surface at every object's middle beam; nobody knows what it is or how exactly.

    `base_from_lidar` (4, 4) leads to the frame `base`, in which the objects are.
    """
    filtered = filter_view(echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m))
    beams = middle_beams(binary(filtered))
    local = places(filtered, beams)
    points = frames.apply(base_from_lidar, np.column_stack([local, np.zeros(len(local))]))[:, :2]
    found = ScanObjects(
        stamp_ns,
        base,
        tuple(str(beam) for beam in beams.tolist()),
        ((("", 1.0),),) * len(beams),
        tuple(point[None] for point in points),
        (np.zeros((1, 2, 2)),) * len(beams),
        np.zeros(len(beams)),
    )
    return replace(scan, ranges_m=filtered.astype(np.float32), intensities=np.zeros(0, np.float32)), found


def degrees(count: int) -> Array:
    """The directions (N,) that the thesis takes beams for, in degrees: the index of one among 360 (decisions.md)."""
    return np.arange(count, dtype=np.float64) * (360.0 / count)


def filter_view(ranges_m: Array) -> Array:
    """Ranges (N,) from 0 to 30 and 330 to 360 degrees and from 0.5 to 15 m, everything else infinite."""
    angle = degrees(len(ranges_m))
    seen = ((angle <= VIEW_DEG) | (angle >= 360.0 - VIEW_DEG)) & (ranges_m >= RANGE_M[0]) & (ranges_m <= RANGE_M[1])
    return np.where(seen, ranges_m, np.inf)


def binary(filtered_m: Array) -> NDArray[np.bool_]:
    """The pattern (N,) of a filtered scan: where a beam met something."""
    return np.isfinite(filtered_m)


def middle_beams(pattern: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The index of the middle beam of every run of ones, from left to right; runs go on across the first beam."""
    count = len(pattern)
    ones = np.flatnonzero(pattern)
    if not len(ones) or len(ones) == count:
        return np.zeros(0, dtype=np.int64)
    from_behind = np.sort((ones - count // 2) % count)  # the scan begins ahead, where objects are
    runs = np.split(from_behind, np.flatnonzero(np.diff(from_behind) > 1) + 1)
    middles = [(int(run[0]) + len(run) // 2 + count // 2) % count for run in runs]
    return np.array(middles[::-1], dtype=np.int64)


def places(ranges_m: Array, beams: NDArray[np.int64]) -> Array:
    """Positions (K, 2) in the LiDAR's frame of objects by their middle beams."""
    angle = np.deg2rad(degrees(len(ranges_m))[beams])
    points: Array = ranges_m[beams, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points
