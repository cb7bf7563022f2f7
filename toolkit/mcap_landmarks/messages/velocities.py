"""SceneVelocities: how fast the objects of a scene move over the ground, which vision_msgs has no field for."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.parts import (
    Array,
    covariance_from_ros,
    header_to_ros,
    make,
    point_from_ros,
    point_to_ros,
    stamp_from_ros,
)
from mcap_landmarks.messages.typestore import RosObject

_RATHER = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class SceneVelocities:
    """N objects of the scene with the same stamp, by their ids: those that were followed for long enough.

    velocities_mps (N, 2) over the ground, along the axes of `frame_id`, with covariances (N, 2, 2) in m^2/s^2; `moving`
    (N,) is how probable it is that they move; it stays 1 for what surely did since it is followed.
    """

    ROS_TYPE: ClassVar[str] = "mcap_landmarks_msgs/msg/SceneVelocities"

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    velocities_mps: Array
    covariances: Array
    moving: Array

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def moving_ids(self) -> frozenset[str]:
        """The ids of what rather moves than stands."""
        return frozenset(name for name, moving in zip(self.ids, self.moving.tolist(), strict=True) if moving >= _RATHER)

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "mcap_landmarks_msgs/SceneVelocities",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            ids=list(self.ids),
            velocities=[_twist_to_ros(*entry) for entry in zip(self.velocities_mps, self.covariances, strict=True)],
            moving=np.ascontiguousarray(self.moving, dtype=np.float64),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        velocities = np.array([point_from_ros(entry.twist.linear)[:2] for entry in ros.velocities])
        covariances = np.array([covariance_from_ros(entry.covariance)[:2, :2] for entry in ros.velocities])
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            tuple(ros.ids),
            velocities.reshape(-1, 2),
            covariances.reshape(-1, 2, 2),
            np.array(ros.moving, dtype=np.float64),
        )


def _twist_to_ros(velocity_mps: Array, covariance: Array) -> RosObject:
    spread = np.zeros((6, 6))
    spread[:2, :2] = covariance
    linear = point_to_ros("geometry_msgs/Vector3", [*velocity_mps, 0.0])
    still = point_to_ros("geometry_msgs/Vector3", [0.0, 0.0, 0.0])
    twist = make("geometry_msgs/Twist", linear=linear, angular=still)
    return make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=spread.reshape(36))
