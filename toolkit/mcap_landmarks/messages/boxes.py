"""Upright boxes of objects, as vision_msgs/BoundingBox3D."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.messages.parts import Array, make, point_from_ros, pose_to_ros, quaternion_from_ros
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """N upright boxes: centres_m (N, 3), sizes_m (N, 3) length, width and height, and yaws_rad (N,) of the lengths."""

    centres_m: Array
    sizes_m: Array
    yaws_rad: Array

    def __len__(self) -> int:
        return len(self.yaws_rad)

    def to_ros(self, i: int) -> RosObject:
        """One of them as `vision_msgs/BoundingBox3D`."""
        half = float(self.yaws_rad[i]) / 2
        turn = (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        x, y, z = self.sizes_m[i].tolist()
        return make(
            "vision_msgs/BoundingBox3D",
            center=pose_to_ros(self.centres_m[i], turn),
            size=make("geometry_msgs/Vector3", x=x, y=y, z=z),
        )

    @classmethod
    def from_ros(cls, boxes: Sequence[RosObject]) -> Self | None:
        """What boxes hold; None where none of them has a height, which are circles seen from above."""
        if not any(box.size.z > 0 for box in boxes):
            return None
        return cls(
            np.array([point_from_ros(box.center.position) for box in boxes]),
            np.array([point_from_ros(box.size) for box in boxes]),
            yaw_from_quaternion([quaternion_from_ros(box.center.orientation) for box in boxes]),
        )
