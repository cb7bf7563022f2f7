"""Scans as points in the robot's base frame, for pictures."""

import contextlib

import numpy as np

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.frames import FrameTree, apply, rigid
from mcap_landmarks.geometry.se2 import Array, exp, transform_points
from mcap_landmarks.lidar.beams import echoes
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.recording.reader import Recording


def own_points(scan: LaserScan) -> tuple[Array, Array]:
    """Where the beams ended (N, 3), in the scanner's own frame, and how long after the stamp, in seconds (N,)."""
    ranges_m = echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    rows = np.flatnonzero(np.isfinite(ranges_m))
    late_s = np.asarray(rows * (scan.time_increment_s if scan.duration_ns else 0.0), np.float64)
    angle, range_m = scan.angle_min_rad + rows * scan.angle_increment_rad, ranges_m[rows]
    return np.column_stack([range_m * np.cos(angle), range_m * np.sin(angle), np.zeros(len(rows))]), late_s


def scan_points(scan: LaserScan, base: str, frames: FrameTree, velocity: Array | None = None) -> Array:
    """Where the beams ended (N, 2), in the base frame if transforms lead there, else in the scanner's own.

    With the base's own velocity (3,), forward and left in m/s and turning in rad/s, as seen from where the base was at
    the stamp.
    """
    points, late_s = own_points(scan)
    with contextlib.suppress(RecordingError):
        points = apply(frames.lookup(base, scan.frame_id), points)
    return points[:, :2] if velocity is None else transform_points(exp(late_s[:, None] * velocity), points[:, :2])


def static_frames(recording: Recording) -> FrameTree:
    """The log's frames that stand still to each other."""
    return FrameTree.of(
        (step.frame_id, step.child_frame_id, rigid(step.translation_m, step.rotation_xyzw))
        for connection in recording.connections(TF_STATIC.topic)
        for raw in recording.messages([connection])
        for step in decode(TF_STATIC.message, raw.data).transforms
    )
