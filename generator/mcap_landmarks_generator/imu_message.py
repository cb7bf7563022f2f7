"""What an inertial measurement unit gives, carried as sensor_msgs/Imu."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from mcap_landmarks.messages.parts import (
    header_to_ros,
    make,
    point_from_ros,
    point_to_ros,
    quaternion_to_ros,
    stamp_from_ros,
)
from mcap_landmarks.messages.typestore import RosObject
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Imu:
    """Turn rates (3,) rad/s and specific force (3,) m/s2 about and along the axes of `frame_id`, each with the variance
    of its noise; it has no orientation, which the message says as ROS defines it: covariance -1."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/Imu"

    stamp_ns: int
    frame_id: str
    turn_radps: Floats
    force_mps2: Floats
    turn_variance: float
    force_variance: float

    def to_ros(self) -> RosObject:
        """See `Message`."""
        unknown = np.zeros(9)
        unknown[0] = -1.0
        return make(
            "sensor_msgs/Imu",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            orientation=quaternion_to_ros([0.0, 0.0, 0.0, 1.0]),
            orientation_covariance=unknown,
            angular_velocity=point_to_ros("geometry_msgs/Vector3", self.turn_radps),
            angular_velocity_covariance=np.diag(np.full(3, self.turn_variance)).ravel(),
            linear_acceleration=point_to_ros("geometry_msgs/Vector3", self.force_mps2),
            linear_acceleration_covariance=np.diag(np.full(3, self.force_variance)).ravel(),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            point_from_ros(ros.angular_velocity),
            point_from_ros(ros.linear_acceleration),
            float(ros.angular_velocity_covariance[0]),
            float(ros.linear_acceleration_covariance[0]),
        )
