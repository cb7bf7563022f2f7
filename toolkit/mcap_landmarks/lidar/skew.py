"""What it can cost that a scan could not be de-skewed, or only as well as odometry is: how unsure objects are for that.

A beam at a time t after the moment that is asked for shows things from where the base is then: an error of t times the
velocity, and of t times the turn rate across the line to the thing. Where odometry tells the motion but its wheels
slip, a walk is left of it, whose square grows with t.
"""

import numpy as np

from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan


def unsure_motion(config: ClusterConfig) -> Array:
    """Mean squares (3, 3) of the base's velocity forward, to the left and turning, where no odometry tells it."""
    speed, turn = config.speed_mps**2, np.deg2rad(config.turn_dps) ** 2
    return np.diag([speed, speed, turn])


def motion_left(
    message: LaserScan | PointCloud2, velocity: Array | None, walk: Array, config: ClusterConfig
) -> tuple[Array, Array]:
    """What is left of the base's motion in a scan: mean squares (3, 3) of a velocity, and of a walk in a second.

    `velocity` (3,) is what odometry tells, none without it, and `walk` (3, 3) how it errs, which de-skewing leaves.
    """
    none = np.zeros((3, 3))
    if velocity is None:
        return unsure_motion(config), none
    return (none, walk) if is_timed(message) else (np.outer(velocity, velocity), none)


def skew_covariances(places_xy: Array, offsets_s: Array, motion: Array, walk: Array) -> Array:
    """What is to be added to the covariances of N objects: (N, 2, 2) in m^2.

    They stand at places (N, 2) in the base frame and were measured within `offsets_s` (N,) of the moment that is asked
    for, while the base moved at a velocity of mean squares `motion` (3, 3) and at random by `walk` (3, 3) a second.
    """
    slopes = np.zeros((len(places_xy), 2, 3))
    slopes[:, 0, 0] = slopes[:, 1, 1] = 1.0
    slopes[:, 0, 2], slopes[:, 1, 2] = -places_xy[:, 1], places_xy[:, 0]
    times = np.abs(offsets_s)[:, None, None]
    spread: Array = slopes @ (times**2 * motion + times * walk) @ slopes.transpose(0, 2, 1)
    return spread


def is_timed(message: LaserScan | PointCloud2) -> bool:
    """Whether a message says when each of its beams or points was measured, or that it was all at once."""
    return isinstance(message, PointCloud2) or bool(message.time_increment_s) or not message.scan_time_s


def offsets_s(message: LaserScan | PointCloud2, stamp_ns: int, base_from_lidar: Array, places_xy: Array) -> Array:
    """When things at places (N, 2) in the base frame were measured, in seconds (N,) after a stamp.

    Where a scan does not say, it is the whole time that it takes; of a cloud's points, the time of the last one. Evenly
    spread times have a third of that as their mean square, but errors of one scan go the same way: they do not average
    out over the two to four objects that make a pose, and as those of the pose they are as large as this makes them.
    """
    late_s = ((message.stamp_ns or stamp_ns) - stamp_ns) * 1e-9
    if isinstance(message, PointCloud2):
        times = np.zeros(1) if message.times_ns is None else message.times_ns * 1e-9
        return np.full(len(places_xy), np.abs(late_s + times).max(initial=0.0))
    if not is_timed(message):
        return np.full(len(places_xy), abs(late_s) + message.scan_time_s)
    if not message.stamp_ns:  # the log time stands in, of a whole turn
        late_s = -message.duration_ns * 1e-9
    flat = np.column_stack([places_xy, np.full(len(places_xy), base_from_lidar[2, 3])])
    there = frames.apply(frames.inverse(base_from_lidar), flat)
    turned = np.arctan2(there[:, 1], there[:, 0]) - message.angle_min_rad
    step = message.angle_increment_rad
    beams = (turned * np.sign(step)) % (2 * np.pi) / abs(step)
    timed: Array = late_s + np.minimum(beams, len(message.ranges_m) - 1) * message.duration_ns * 1e-9 / (
        len(message.ranges_m) - 1
    )
    return timed
