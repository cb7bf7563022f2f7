"""Detections: boxes in an image, carried as vision_msgs/Detection2DArray."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.hypotheses import Hypotheses, hypotheses_from_ros, place_to_ros, results_to_ros
from mcap_landmarks.messages.parts import Array, header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """N boxes in pixels of the original image: boxes_xyxy (N, 4); per box its hypotheses, best first, and an id."""

    ROS_TYPE: ClassVar[str] = "vision_msgs/msg/Detection2DArray"

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    hypotheses: tuple[Hypotheses, ...]
    boxes_xyxy: Array

    def __len__(self) -> int:
        return len(self.ids)

    def to_ros(self) -> RosObject:
        """See `Message`."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        nowhere = place_to_ros(np.zeros(2), np.zeros((2, 2)))
        detections = []
        for box, options, name in zip(self.boxes_xyxy, self.hypotheses, self.ids, strict=True):
            results = results_to_ros(options, [nowhere] * len(options))
            detections.append(
                make("vision_msgs/Detection2D", header=header, results=results, bbox=_box_to_ros(box), id=name)
            )
        return make("vision_msgs/Detection2DArray", header=header, detections=detections)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        boxes = np.zeros((len(ros.detections), 4))
        for i, detection in enumerate(ros.detections):
            centre, half_x, half_y = (
                detection.bbox.center.position,
                detection.bbox.size_x / 2,
                detection.bbox.size_y / 2,
            )
            boxes[i] = centre.x - half_x, centre.y - half_y, centre.x + half_x, centre.y + half_y
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            tuple(detection.id for detection in ros.detections),
            tuple(hypotheses_from_ros(detection) for detection in ros.detections),
            boxes,
        )


def _box_to_ros(box_xyxy: Array) -> RosObject:
    x1, y1, x2, y2 = box_xyxy.tolist()
    centre = make("vision_msgs/Point2D", x=(x1 + x2) / 2, y=(y1 + y2) / 2)
    pose = make("vision_msgs/Pose2D", position=centre, theta=0.0)
    return make("vision_msgs/BoundingBox2D", center=pose, size_x=x2 - x1, size_y=y2 - y1)
