"""Scans and point clouds of a bundle as beams in the base frame."""

import numpy as np

from toolkit.channels import BASE_FRAME, SCAN, SECOND_SCAN, TF_STATIC
from toolkit.errors import RecordingError, UsageError
from toolkit.geometry import frames
from toolkit.geometry.se2 import Array
from toolkit.lidar.beams import Beams, Limits, echoes, sweep, together
from toolkit.lidar.clouds import slice_cloud
from toolkit.messages.codec import Message
from toolkit.messages.points import PointCloud2
from toolkit.messages.scan import LaserScan
from toolkit.stage import Bundle
from toolkit.stages._cluster_config import ClusterConfig
from toolkit.stages._mounting import Mounting

_LONGEST_TURN_S = 2.0
"""Beams that are said to take longer than this have times that make no sense."""
_BASES = (BASE_FRAME, "base_link")


def base_of(bundle: Bundle, mounting: Mounting) -> str:
    """The base frame, which is the LiDAR's own only if the log says so.

    Raises:
        RecordingError: there are no transforms, and the scan is in no base frame.
    """
    frame = frame_of(bundle.messages[SCAN])
    base = mounting.base(bundle, frame)
    if base == frames.plain(frame) and base not in _BASES and TF_STATIC not in bundle.messages:
        raise RecordingError(f"nothing says where the LiDAR ({base}) sits on the robot; {frames.REMEDY}")
    return base


def frame_of(message: Message) -> str:
    """The frame of a scan or point cloud."""
    assert isinstance(message, LaserScan | PointCloud2)  # noqa: S101 - the runner reads no other types as scans
    return message.frame_id


def beams_of(bundle: Bundle, base: str, mounting: Mounting, config: ClusterConfig) -> Beams | None:
    """The beams of a bundle's LiDARs, None if none of them makes sense.

    Raises:
        RecordingError: no transforms lead from a LiDAR to the base frame.
        UsageError: there is a point cloud, and no heights to cut it at.
    """
    limits = _limits(config)
    found = []
    for channel in (SCAN, SECOND_SCAN):
        message = bundle.messages.get(channel)
        if message is None:
            continue
        base_from_lidar = mounting.lookup(bundle, base, frame_of(message))
        if isinstance(message, PointCloud2):
            found.append(_slice(message, base_from_lidar, config, limits))
        elif isinstance(message, LaserScan) and makes_sense(message):
            found.append(_sweep(message, bundle, base_from_lidar, limits))
    return together(found) if found else None


def makes_sense(scan: LaserScan) -> bool:
    """Whether a scan has beams in known directions."""
    return (
        bool(np.isfinite([scan.angle_min_rad, scan.angle_increment_rad]).all())
        and scan.angle_increment_rad != 0
        and len(scan.ranges_m) > 1
    )


def _limits(config: ClusterConfig) -> Limits:
    if config.view_deg is None:
        return Limits(config.range_m or (0.0, np.inf))
    low, high = np.deg2rad(config.view_deg).tolist()
    return Limits(config.range_m or (0.0, np.inf), (low, high))


def _sweep(scan: LaserScan, bundle: Bundle, base_from_lidar: Array, limits: Limits) -> Beams:
    places = np.arange(len(scan.ranges_m), dtype=np.float64)
    return sweep(
        scan.angle_min_rad + places * scan.angle_increment_rad,
        echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m),
        base_from_lidar,
        _times_s(scan, bundle.stamp_ns),
        None if bundle.odometry is None else bundle.odometry.velocity,
        limits,
    )


def _times_s(scan: LaserScan, stamp_ns: int) -> Array:
    """When each beam (N,) was, after a time; all at once where the scan does not say."""
    turn_s = scan.time_increment_s * len(scan.ranges_m)
    step_s = scan.time_increment_s if 0 < turn_s <= _LONGEST_TURN_S else 0.0
    late_s = (scan.stamp_ns - stamp_ns) / 1e9 if scan.stamp_ns else 0.0
    return late_s + step_s * np.arange(len(scan.ranges_m), dtype=np.float64)


def _slice(cloud: PointCloud2, base_from_lidar: Array, config: ClusterConfig, limits: Limits) -> Beams:
    if config.slice_m is None:
        raise UsageError("a point cloud is cut between two heights above the base frame: give --slice ZMIN:ZMAX in m")
    points = frames.apply(base_from_lidar, cloud.points_m)
    return slice_cloud(points, base_from_lidar[:2, 3], config.slice_m, np.deg2rad(config.slice_beam_deg), limits)
