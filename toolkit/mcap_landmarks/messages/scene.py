"""SceneObjects: objects in the plane with classes and covariance, carried as vision_msgs/Detection3DArray."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.hypotheses import (
    Hypotheses,
    flat_box_to_ros,
    hypotheses_from_ros,
    object_to_ros,
    place_to_ros,
    placed,
    results_to_ros,
)
from mcap_landmarks.messages.parts import Array, header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class SceneObjects:
    """N objects in `frame_id`, one message per scan.

    ids: track, landmark or truth ids. hypotheses: per object (class name, probability), most probable first.
    positions_xy (N, 2) are the centres of the cross-sections in metres; covariances (N, 2, 2) in m^2, all zero where
    unknown; radii_m (N,), zero where unknown. `boxes` say how the objects of a cloud lie: their lengths are twice the
    radii.
    """

    ROS_TYPE: ClassVar[str] = "vision_msgs/msg/Detection3DArray"

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    hypotheses: tuple[Hypotheses, ...]
    positions_xy: Array
    covariances: Array
    radii_m: Array
    boxes: Boxes | None = None

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def classes(self) -> tuple[str, ...]:
        """The most probable class of each object, empty where it has none."""
        return tuple(options[0][0] if options else "" for options in self.hypotheses)

    def to_ros(self) -> RosObject:
        """See `Message`."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        return make(
            "vision_msgs/Detection3DArray",
            header=header,
            detections=[self._object_to_ros(header, i) for i in range(len(self))],
        )

    def _object_to_ros(self, header: RosObject, i: int) -> RosObject:
        place = place_to_ros(self.positions_xy[i], self.covariances[i])
        results = results_to_ros(self.hypotheses[i], [place] * len(self.hypotheses[i]))
        flat = flat_box_to_ros(self.positions_xy[i].tolist(), 2 * float(self.radii_m[i]))
        return object_to_ros(header, self.ids[i], results, self.boxes.to_ros(i) if self.boxes else flat)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`; an object without any result keeps the centre of its box and an unknown covariance."""
        detections = ros.detections
        positions, covariances = np.zeros((len(detections), 2)), np.zeros((len(detections), 2, 2))
        for i, detection in enumerate(detections):
            first = placed(detection)
            point = (first.pose if first else detection.bbox.center).position
            positions[i] = point.x, point.y
            if first:
                covariances[i] = np.asarray(first.covariance).reshape(6, 6)[:2, :2]
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            tuple(detection.id for detection in detections),
            tuple(hypotheses_from_ros(detection) for detection in detections),
            positions,
            covariances,
            np.array([detection.bbox.size.x / 2 for detection in detections], dtype=np.float64),
            Boxes.from_ros([detection.bbox for detection in detections]),
        )
