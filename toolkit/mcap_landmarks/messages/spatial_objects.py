"""SpatialObjects: objects anywhere in space, in any frame, as vision_msgs/Detection3DArray carries those of others."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.geometry import frames
from mcap_landmarks.messages.parts import Array, covariance_from_ros, point_from_ros
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class SpatialObjects:
    """N objects: positions_m (N, 3) and covariances (N, 3, 3) in m^2, all zero where unknown."""

    ROS_TYPE: ClassVar[str] = SceneObjects.ROS_TYPE

    positions_m: Array
    covariances: Array

    def to_ros(self) -> RosObject:
        """See `Message`; others write these."""
        raise NotImplementedError

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`; an object without any result keeps the centre of its box and an unknown covariance."""
        positions, covariances = np.zeros((len(ros.detections), 3)), np.zeros((len(ros.detections), 3, 3))
        for i, detection in enumerate(ros.detections):
            first = detection.results[0].pose if detection.results else None
            positions[i] = point_from_ros((first.pose if first else detection.bbox.center).position)
            if first:
                covariances[i] = covariance_from_ros(first.covariance)[:3, :3]
        return cls(positions, covariances)

    def seen_from_above(self, scene: SceneObjects, base: str, base_from_frame: Array) -> SceneObjects:
        """The same objects, as `scene` has them, in the plane of the base frame, which base_from_frame (4, 4) tells.

        A covariance that leaves a direction out says nothing of the plane, and is unknown.
        """
        turn, whole = base_from_frame[:3, :3], self.covariances
        with np.errstate(invalid="ignore"):
            known = np.isfinite(whole).all(axis=(1, 2)) & (np.linalg.det(np.nan_to_num(whole)) > 0)
        spread = np.where(known[:, None, None], turn @ whole @ turn.T, 0.0)
        return replace(
            scene,
            frame_id=base,
            positions_xy=frames.apply(base_from_frame, self.positions_m)[:, :2],
            covariances=spread[:, :2, :2],
            boxes=None,
        )
