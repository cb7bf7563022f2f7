"""Scan messages and point clouds as beams in the base frame, each at the time it was measured."""

import math

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import Beams, Limits, echoes, sweep
from mcap_landmarks.lidar.clouds import in_slice, slice_beams
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.whole_clouds import BaseFromThen
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan

_LEAST_LEVEL = 0.5
"""The cosine of 60 degrees: LiDARs that look ahead at the floor are tilted by less, those on their side by 90."""


def check_level(frame: str, base_from_lidar: Array) -> None:
    """See that a planar LiDAR mounted at `base_from_lidar` (4, 4), upside down or not, scans more or less level.

    Raises:
        RecordingError: its scan plane is too steep to see what stands on the floor as it is.
    """
    if abs(base_from_lidar[2, 2]) < _LEAST_LEVEL:
        tilt_deg = math.degrees(math.acos(abs(base_from_lidar[2, 2])))
        raise RecordingError(
            f"the scan plane of {frames.plain(frame)} is not level: by the transforms it is tilted by {tilt_deg:.0f} "
            "deg; correct how the LiDAR is mounted, or choose the topic of one that scans level with --scan"
        )


def returns_nothing(scan: LaserScan) -> bool:
    """Whether no beam of a scan met anything."""
    return not np.isfinite(echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m)).any()


def beams_of(
    message: LaserScan | PointCloud2,
    stamp_ns: int,
    base_from_lidar: Array,
    base_from_then: BaseFromThen | None,
    config: ClusterConfig,
) -> Beams:
    """The beams of one LiDAR mounted at `base_from_lidar` (4, 4); scans are as the standard has them (`scan_repair`).

    `stamp_ns` stands in where the message has no stamp. Without `base_from_then` the base stood still meanwhile.

    Raises:
        RecordingError: the plane of a scan is not level.
        UsageError: there is a point cloud, and no heights to cut it at.
    """
    if isinstance(message, PointCloud2):
        return _slice(message, stamp_ns, base_from_lidar, base_from_then, config)
    check_level(message.frame_id, base_from_lidar)
    places = np.arange(len(message.ranges_m), dtype=np.float64)
    return sweep(
        message.angle_min_rad + places * message.angle_increment_rad,
        echoes(message.ranges_m, message.range_min_m, message.range_max_m),
        base_from_lidar,
        None if base_from_then is None else base_from_then(_times_ns(message, stamp_ns)),
        _limits(config),
    )


def _limits(config: ClusterConfig) -> Limits:
    if config.view_deg is None:
        return Limits(config.range_m or (0.0, np.inf))
    low, high = config.view_deg
    across = high - low if high > low else (high - low) % 360.0  # 330 to 30 is what -30 to 30 is
    return Limits(config.range_m or (0.0, np.inf), (math.radians(low), math.radians(low + across)))


def _times_ns(scan: LaserScan, stamp_ns: int) -> NDArray[np.int64]:
    """When each beam (N,) was; all at once where the scan does not say."""
    first_ns = scan.stamp_ns or stamp_ns - scan.duration_ns  # without a stamp the log time counts, of a whole turn
    count = len(scan.ranges_m)
    return first_ns + np.arange(count, dtype=np.int64) * scan.duration_ns // max(count - 1, 1)


def _slice(
    cloud: PointCloud2,
    stamp_ns: int,
    base_from_lidar: Array,
    base_from_then: BaseFromThen | None,
    config: ClusterConfig,
) -> Beams:
    if config.slice_m is None:
        raise UsageError(
            "a point cloud joins a planar scan as a slice between two heights: give --slice ZMIN:ZMAX in m"
        )
    points = frames.apply(base_from_lidar, cloud.points_m)
    inside, moved = in_slice(points, config.slice_m), None
    if base_from_then is not None and cloud.times_ns is not None and inside.any():
        moved = base_from_then((cloud.stamp_ns or stamp_ns) + cloud.times_ns[inside])
    beam_rad = np.deg2rad(config.slice_beam_deg)
    return slice_beams(points[inside, :2], base_from_lidar[:2, 3], beam_rad, moved, _limits(config))
