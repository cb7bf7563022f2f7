"""What a LiDAR scan shows before anyone knows its class, carried as vision_msgs/Detection3DArray."""

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
    results_to_ros,
)
from mcap_landmarks.messages.parts import Array, header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class ScanObjects:
    """N objects in `frame_id`, one message per scan; object i could be any of its K_i hypotheses.

    ids: track ids. hypotheses: per object (class name, probability), which sum to 1: most probable first, a class as
    often as it has shapes, and at last ("", probability that it is none of them), the bare surface.
    positions_xy[i] (K_i, 2): the centre of the cross-section in metres under each hypothesis, of the bare surface its
    middle as the scan sees it; covariances[i] (K_i, 2, 2) in m^2. extents_m (N,): the largest distance of two hits.
    `boxes` hug the objects of a cloud, which has no shapes to compare with: their lengths are the extents.
    """

    ROS_TYPE: ClassVar[str] = "vision_msgs/msg/Detection3DArray"

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    hypotheses: tuple[Hypotheses, ...]
    positions_xy: tuple[Array, ...]
    covariances: tuple[Array, ...]
    extents_m: Array
    boxes: Boxes | None = None

    def __len__(self) -> int:
        return len(self.ids)

    def to_ros(self) -> RosObject:
        """See `Message`; a box that is not known spans the object's extent about the last hypothesis."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        return make(
            "vision_msgs/Detection3DArray",
            header=header,
            detections=[self._object_to_ros(header, i) for i in range(len(self))],
        )

    def _object_to_ros(self, header: RosObject, i: int) -> RosObject:
        places = [place_to_ros(*place) for place in zip(self.positions_xy[i], self.covariances[i], strict=True)]
        results = results_to_ros(self.hypotheses[i], places)
        middle = self.positions_xy[i][-1].tolist() if results else (0.0, 0.0)
        box = self.boxes.to_ros(i) if self.boxes else flat_box_to_ros(middle, float(self.extents_m[i]))
        return object_to_ros(header, self.ids[i], results, box)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        hypotheses, positions, covariances = [], [], []
        for detection in ros.detections:
            results = detection.results
            hypotheses.append(hypotheses_from_ros(detection))
            points = [(one.pose.pose.position.x, one.pose.pose.position.y) for one in results]
            spreads = [np.asarray(one.pose.covariance, dtype=np.float64).reshape(6, 6)[:2, :2] for one in results]
            positions.append(np.array(points, dtype=np.float64).reshape(-1, 2))
            covariances.append(np.array(spreads, dtype=np.float64).reshape(-1, 2, 2))
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            tuple(detection.id for detection in ros.detections),
            tuple(hypotheses),
            tuple(positions),
            tuple(covariances),
            np.array([detection.bbox.size.x for detection in ros.detections], dtype=np.float64),
            Boxes.from_ros([detection.bbox for detection in ros.detections]),
        )
