"""Scans and point clouds of a bundle as beams in the base frame."""

import math

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import BASE_FRAME, SCAN, SECOND_SCAN, TF_STATIC
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array, between, exp, interpolate
from mcap_landmarks.lidar.beams import Beams, Limits, echoes, sweep, together
from mcap_landmarks.lidar.clouds import in_slice, slice_beams
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, OdometryAt
from mcap_landmarks.stages._cluster_config import ClusterConfig

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
            found.append(_slice(message, bundle, base_from_lidar, config, limits))
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
    low, high = config.view_deg
    across = high - low if high > low else (high - low) % 360.0  # 330 to 30 is what -30 to 30 is
    return Limits(config.range_m or (0.0, np.inf), (math.radians(low), math.radians(low + across)))


def _sweep(scan: LaserScan, bundle: Bundle, base_from_lidar: Array, limits: Limits) -> Beams:
    places = np.arange(len(scan.ranges_m), dtype=np.float64)
    return sweep(
        scan.angle_min_rad + places * scan.angle_increment_rad,
        echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m),
        base_from_lidar,
        None if bundle.odometry is None else _moved(bundle.odometry, bundle.stamp_ns, _times_ns(scan, bundle.stamp_ns)),
        limits,
    )


def _times_ns(scan: LaserScan, stamp_ns: int) -> NDArray[np.int64]:
    """When each beam (N,) was; all at once where the scan does not say."""
    first_ns = scan.stamp_ns or stamp_ns - scan.duration_ns  # without a stamp the log time counts, of a whole turn
    count = len(scan.ranges_m)
    return first_ns + np.arange(count, dtype=np.int64) * scan.duration_ns // max(count - 1, 1)


def _moved(odometry: OdometryAt, stamp_ns: int, times_ns: NDArray[np.int64]) -> Array:
    """Where the base was at some times (N, 3), in the base frame at another."""
    steps = odometry.steps
    if steps is None or not (len(steps.stamps_ns) > 1 and steps.stamps_ns[0] <= times_ns.min()):
        return exp((times_ns - stamp_ns)[:, None] / 1e9 * odometry.velocity)
    # What the log does not tell any more is little: a bundle waits until odometry has passed its last beam.
    known = np.minimum(times_ns, steps.stamps_ns[-1])
    return between(odometry.odom_from_base, interpolate(steps.stamps_ns, steps.odom_from_base, known))


def _slice(cloud: PointCloud2, bundle: Bundle, base_from_lidar: Array, config: ClusterConfig, limits: Limits) -> Beams:
    if config.slice_m is None:
        raise UsageError("a point cloud is cut between two heights above the base frame: give --slice ZMIN:ZMAX in m")
    points = frames.apply(base_from_lidar, cloud.points_m)
    inside, moved = in_slice(points, config.slice_m), None
    if bundle.odometry is not None and cloud.times_ns is not None and inside.any():
        times_ns = (cloud.stamp_ns or bundle.stamp_ns) + cloud.times_ns[inside]
        moved = _moved(bundle.odometry, bundle.stamp_ns, times_ns)
    beam_rad = np.deg2rad(config.slice_beam_deg)
    return slice_beams(points[inside, :2], base_from_lidar[:2, 3], beam_rad, moved, limits)
