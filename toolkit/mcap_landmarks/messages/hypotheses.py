"""What objects could be, and objects in the plane, as vision_msgs carries them."""

from collections.abc import Iterable

import numpy as np

from mcap_landmarks.messages.parts import Array, make, pose_to_ros, pose_with_covariance_to_ros
from mcap_landmarks.messages.typestore import RosObject

Hypotheses = tuple[tuple[str, float], ...]
"""Class names with their probabilities."""

_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def place_to_ros(position_xy: Array, covariance: Array) -> RosObject:
    """A `geometry_msgs/PoseWithCovariance` of a place (2,) with its covariance (2, 2); the rest of both is zero."""
    spread = np.zeros((6, 6))
    spread[:2, :2] = covariance
    return pose_with_covariance_to_ros((*position_xy.tolist(), 0.0), _UPRIGHT, spread)


def results_to_ros(hypotheses: Iterable[tuple[str, float]], places: Iterable[RosObject]) -> list[RosObject]:
    """A `vision_msgs/ObjectHypothesisWithPose` for each hypothesis, with its place."""
    return [
        make(
            "vision_msgs/ObjectHypothesisWithPose",
            hypothesis=make("vision_msgs/ObjectHypothesis", class_id=name, score=score),
            pose=place,
        )
        for (name, score), place in zip(hypotheses, places, strict=True)
    ]


def hypotheses_from_ros(detection: RosObject) -> Hypotheses:
    """The class names and probabilities of a detection's results, in their order."""
    return tuple((result.hypothesis.class_id, float(result.hypothesis.score)) for result in detection.results)


def flat_box_to_ros(middle_xy: Iterable[float], size_m: float) -> RosObject:
    """A `vision_msgs/BoundingBox3D` without a height, as long as it is wide."""
    return make(
        "vision_msgs/BoundingBox3D",
        center=pose_to_ros((*middle_xy, 0.0), _UPRIGHT),
        size=make("geometry_msgs/Vector3", x=size_m, y=size_m, z=0.0),
    )


def object_to_ros(header: RosObject, identity: str, results: list[RosObject], box: RosObject) -> RosObject:
    """A `vision_msgs/Detection3D`."""
    return make("vision_msgs/Detection3D", header=header, results=results, bbox=box, id=identity)


def placed(detection: RosObject) -> RosObject | None:
    """The pose with covariance of a `vision_msgs/Detection3D`, None where only its box tells where it is.

    Detectors often leave the poses of results as they are made, all zero.
    """
    first = detection.results[0].pose if detection.results else None
    if first is None:
        return None
    at, middle = first.pose.position, detection.bbox.center.position
    is_unset = not (at.x or at.y or at.z) and bool(middle.x or middle.y or middle.z) and not first.covariance.any()
    return None if is_unset else first
