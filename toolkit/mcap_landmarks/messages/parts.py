"""The pieces that messages share: time stamps, headers, poses, covariances."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.messages.typestore import RosObject, full_name, typestore

Array = NDArray[np.float64]
PLANAR = np.ix_([0, 1, 5], [0, 1, 5])


def make(ros_type: str, **fields: object) -> RosObject:
    """Object of the typestore; `geometry_msgs/Pose` is short for `geometry_msgs/msg/Pose`."""
    return _class(ros_type)(**fields)


@cache
def _class(ros_type: str) -> Callable[..., RosObject]:
    return typestore().types[full_name(ros_type)]


def stamp_to_ros(stamp_ns: int) -> RosObject:
    """Nanoseconds since the epoch as `builtin_interfaces/Time`."""
    return make("builtin_interfaces/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def stamp_from_ros(time: RosObject) -> int:
    """Nanoseconds of a `builtin_interfaces/Time`."""
    return int(time.sec) * 10**9 + int(time.nanosec)


def header_to_ros(stamp_ns: int, frame_id: str) -> RosObject:
    """A `std_msgs/Header`."""
    return make("std_msgs/Header", stamp=stamp_to_ros(stamp_ns), frame_id=frame_id)


def point_to_ros(ros_type: str, values: ArrayLike) -> RosObject:
    """Three numbers as `geometry_msgs/Point` or `geometry_msgs/Vector3`."""
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return make(ros_type, x=x, y=y, z=z)


def point_from_ros(point: RosObject) -> Array:
    """The (3,) of a point or vector."""
    return np.array([point.x, point.y, point.z], dtype=np.float64)


def quaternion_to_ros(values_xyzw: ArrayLike) -> RosObject:
    """Four numbers as `geometry_msgs/Quaternion`."""
    x, y, z, w = np.asarray(values_xyzw, dtype=np.float64).tolist()
    return make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)


def quaternion_from_ros(quaternion: RosObject) -> Array:
    """The (4,) x, y, z, w of a quaternion."""
    return np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w], dtype=np.float64)


def pose_to_ros(position_m: ArrayLike, orientation_xyzw: ArrayLike) -> RosObject:
    """A `geometry_msgs/Pose`."""
    return make(
        "geometry_msgs/Pose",
        position=point_to_ros("geometry_msgs/Point", position_m),
        orientation=quaternion_to_ros(orientation_xyzw),
    )


def pose_with_covariance_to_ros(position_m: ArrayLike, orientation_xyzw: ArrayLike, covariance: Array) -> RosObject:
    """A `geometry_msgs/PoseWithCovariance` from a (6, 6) covariance."""
    pose = pose_to_ros(position_m, orientation_xyzw)
    return make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=np.ascontiguousarray(covariance).ravel())


def covariance_from_ros(covariance: RosObject) -> Array:
    """The (6, 6) of a flat covariance of 36 numbers, in ROS's order x, y, z and rotations about them."""
    return np.array(covariance, dtype=np.float64).reshape(6, 6)


def spread_planar(covariance: Array) -> Array:
    """(6, 6) pose covariance whose x, y, yaw entries are the given (3, 3)."""
    full = np.zeros((6, 6))
    full[PLANAR] = covariance
    return full


def planar_parts(pose_xyh: ArrayLike) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) of a pose x, y, heading in the plane."""
    x, y, heading = np.asarray(pose_xyh, dtype=np.float64).tolist()
    # As `quaternion_from_yaw`, without the cost of arrays for one angle.
    return np.array([x, y, 0.0]), np.array([0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)])


def planar_pose(position_m: Array, orientation_xyzw: Array) -> Array:
    """(3,) x, y, heading of a position and a quaternion."""
    return np.array([position_m[0], position_m[1], float(yaw_from_quaternion(orientation_xyzw))])
