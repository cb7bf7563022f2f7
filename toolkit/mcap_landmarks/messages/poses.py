"""PoseStamped, PoseWithCovarianceStamped, Path and Odometry."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks.messages.parts import (
    PLANAR,
    Array,
    covariance_from_ros,
    header_to_ros,
    make,
    planar_parts,
    planar_pose,
    point_from_ros,
    point_to_ros,
    pose_to_ros,
    pose_with_covariance_to_ros,
    quaternion_from_ros,
    spread_planar,
    stamp_from_ros,
)
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class PoseStamped:
    """Pose of something in `frame_id`: position (3,) in metres, quaternion (4,) x, y, z, w."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/msg/PoseStamped"

    stamp_ns: int
    frame_id: str
    position_m: Array
    orientation_xyzw: Array

    @classmethod
    def planar(cls, stamp_ns: int, frame_id: str, pose: ArrayLike) -> Self:
        """Pose x, y, heading in the plane."""
        return cls(stamp_ns, frame_id, *planar_parts(pose))

    @property
    def pose(self) -> Array:
        """x, y, heading (3,)."""
        return planar_pose(self.position_m, self.orientation_xyzw)

    def to_ros(self) -> RosObject:
        """See `Message`."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        return make(
            "geometry_msgs/PoseStamped", header=header, pose=pose_to_ros(self.position_m, self.orientation_xyzw)
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        pose = ros.pose
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            point_from_ros(pose.position),
            quaternion_from_ros(pose.orientation),
        )


@dataclass(frozen=True, slots=True, eq=False)
class PoseWithCovarianceStamped:
    """As `PoseStamped`, with a (6, 6) covariance in ROS's order."""

    ROS_TYPE: ClassVar[str] = "geometry_msgs/msg/PoseWithCovarianceStamped"

    stamp_ns: int
    frame_id: str
    position_m: Array
    orientation_xyzw: Array
    covariance: Array

    @classmethod
    def planar(cls, stamp_ns: int, frame_id: str, pose: ArrayLike, covariance: Array) -> Self:
        """Pose x, y, heading with its (3, 3) covariance; all other entries are zero."""
        return cls(stamp_ns, frame_id, *planar_parts(pose), spread_planar(covariance))

    @property
    def pose(self) -> Array:
        """x, y, heading (3,)."""
        return planar_pose(self.position_m, self.orientation_xyzw)

    @property
    def planar_covariance(self) -> Array:
        """Covariance (3, 3) of x, y, heading."""
        return self.covariance[PLANAR]

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            pose=pose_with_covariance_to_ros(self.position_m, self.orientation_xyzw, self.covariance),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        pose = ros.pose.pose
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            point_from_ros(pose.position),
            quaternion_from_ros(pose.orientation),
            covariance_from_ros(ros.pose.covariance),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A trajectory in `frame_id`: poses with stamps of their own."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/msg/Path"

    stamp_ns: int
    frame_id: str
    poses: tuple[PoseStamped, ...]

    def to_ros(self) -> RosObject:
        """See `Message`."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        return make("nav_msgs/Path", header=header, poses=[pose.to_ros() for pose in self.poses])

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        poses = tuple(PoseStamped.from_ros(pose) for pose in ros.poses)
        return cls(stamp_from_ros(ros.header.stamp), ros.header.frame_id, poses)


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """Pose of `child_frame_id` in `frame_id` and its velocity in `child_frame_id`.

    position (3,) m, quaternion (4,) x, y, z, w, covariances (6, 6), linear (3,) m/s, angular (3,) rad/s.
    """

    ROS_TYPE: ClassVar[str] = "nav_msgs/msg/Odometry"

    stamp_ns: int
    frame_id: str
    child_frame_id: str
    position_m: Array
    orientation_xyzw: Array
    pose_covariance: Array
    linear_mps: Array
    angular_radps: Array
    twist_covariance: Array

    @classmethod
    def planar(
        cls,
        stamp_ns: int,
        frames: tuple[str, str],
        pose: ArrayLike,
        covariance: Array,
        speeds: tuple[float, float] = (0.0, 0.0),
    ) -> Self:
        """Odometry of a robot in the plane.

        frames are (odom, base), pose x, y, heading with its (3, 3) covariance, speeds forward in m/s and turn in rad/s.
        """
        position, orientation = planar_parts(pose)
        linear, angular = np.array([speeds[0], 0.0, 0.0]), np.array([0.0, 0.0, speeds[1]])
        spread = spread_planar(covariance)
        return cls(stamp_ns, *frames, position, orientation, spread, linear, angular, np.zeros((6, 6)))

    @property
    def pose(self) -> Array:
        """x, y, heading (3,)."""
        return planar_pose(self.position_m, self.orientation_xyzw)

    @property
    def planar_covariance(self) -> Array:
        """Covariance (3, 3) of x, y, heading."""
        return self.pose_covariance[PLANAR]

    def to_ros(self) -> RosObject:
        """See `Message`."""
        twist = make(
            "geometry_msgs/Twist",
            linear=point_to_ros("geometry_msgs/Vector3", self.linear_mps),
            angular=point_to_ros("geometry_msgs/Vector3", self.angular_radps),
        )
        return make(
            "nav_msgs/Odometry",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            child_frame_id=self.child_frame_id,
            pose=pose_with_covariance_to_ros(self.position_m, self.orientation_xyzw, self.pose_covariance),
            twist=make(
                "geometry_msgs/TwistWithCovariance",
                twist=twist,
                covariance=np.ascontiguousarray(self.twist_covariance).ravel(),
            ),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        pose, twist = ros.pose.pose, ros.twist.twist
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            ros.child_frame_id,
            point_from_ros(pose.position),
            quaternion_from_ros(pose.orientation),
            covariance_from_ros(ros.pose.covariance),
            point_from_ros(twist.linear),
            point_from_ros(twist.angular),
            covariance_from_ros(ros.twist.covariance),
        )
