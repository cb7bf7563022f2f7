"""Objects anywhere in space, in any frame, as vision_msgs/Detection3DArray carries those of others."""

from dataclasses import replace

import numpy as np

from mcap_landmarks.geometry import frames
from mcap_landmarks.messages.codec import read_as
from mcap_landmarks.messages.hypotheses import placed
from mcap_landmarks.messages.parts import Array, covariance_from_ros, point_from_ros
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import RosObject


def seen_from_above(scene: SceneObjects, data: bytes | memoryview, base: str, base_from_frame: Array) -> SceneObjects:
    """A message's objects in the plane of the base frame, which base_from_frame (4, 4) tells; `scene` is it decoded.

    A covariance that leaves a direction out says nothing of the plane, and is unknown.
    """
    positions, whole = read_as(_in_space, SceneObjects.ROS_TYPE, data)
    turn = base_from_frame[:3, :3]
    with np.errstate(invalid="ignore"):
        known = np.isfinite(whole).all(axis=(1, 2)) & (np.linalg.det(np.nan_to_num(whole)) > 0)
    spread = np.where(known[:, None, None], turn @ whole @ turn.T, 0.0)
    places = frames.apply(base_from_frame, positions)[:, :2]
    return replace(scene, frame_id=base, positions_xy=places, covariances=spread[:, :2, :2], boxes=None)


def _in_space(ros: RosObject) -> tuple[Array, Array]:
    """Positions (N, 3) and covariances (N, 3, 3) in m^2; without a result the centre of the box, and unknown."""
    positions, covariances = np.zeros((len(ros.detections), 3)), np.zeros((len(ros.detections), 3, 3))
    for i, detection in enumerate(ros.detections):
        first = placed(detection)
        positions[i] = point_from_ros((first.pose if first else detection.bbox.center).position)
        if first:
            covariances[i] = covariance_from_ros(first.covariance)[:3, :3]
    return positions, covariances
