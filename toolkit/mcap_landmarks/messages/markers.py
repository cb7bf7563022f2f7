"""MarkerArray: shapes and texts that RViz and Foxglove draw."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.messages.annotations import Color
from mcap_landmarks.messages.parts import (
    Array,
    header_to_ros,
    make,
    point_from_ros,
    point_to_ros,
    pose_to_ros,
    quaternion_from_ros,
    stamp_from_ros,
)
from mcap_landmarks.messages.typestore import RosObject


class MarkerShape(IntEnum):
    """The marker types in use."""

    CUBE = 1
    CYLINDER = 3
    LINE_STRIP = 4
    TEXT_VIEW_FACING = 9


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """One shape at position_m (3,), of size_m (3,), optionally through points_m (N, 3); `name` and `number` key it.

    `yaw_rad` is the direction of its x axis.
    """

    name: str
    number: int
    shape: MarkerShape
    position_m: Array
    size_m: Array
    color: Color
    text: str = ""
    points_m: Array = field(default_factory=lambda: np.zeros((0, 3)))
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class MarkerArray:
    """Markers of one time and frame; `replaces` takes away all that were drawn on the topic before."""

    ROS_TYPE: ClassVar[str] = "visualization_msgs/msg/MarkerArray"

    stamp_ns: int
    frame_id: str
    markers: tuple[Marker, ...]
    replaces: bool = False

    def to_ros(self) -> RosObject:
        """See `Message`."""
        header = header_to_ros(self.stamp_ns, self.frame_id)
        first = [_to_ros(header, _ALL, _DELETE_ALL)] if self.replaces else []
        return make(
            "visualization_msgs/MarkerArray", markers=[*first, *(_to_ros(header, marker) for marker in self.markers)]
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`; an empty array has the stamp 0 and no frame."""
        if not ros.markers:
            return cls(0, "", ())
        header, replaces = ros.markers[0].header, ros.markers[0].action == _DELETE_ALL
        shown = tuple(_from_ros(marker) for marker in ros.markers[replaces:])
        return cls(stamp_from_ros(header.stamp), header.frame_id, shown, replaces)


_ADD, _DELETE_ALL = 0, 3  # of visualization_msgs/Marker
_ALL = Marker("", 0, MarkerShape.CYLINDER, np.zeros(3), np.zeros(3), (0.0, 0.0, 0.0, 0.0))


def _to_ros(header: RosObject, marker: Marker, action: int = _ADD) -> RosObject:
    r, g, b, a = marker.color
    turn = (0.0, 0.0, float(np.sin(marker.yaw_rad / 2)), float(np.cos(marker.yaw_rad / 2)))
    nothing = np.zeros(0, dtype=np.uint8)
    return make(
        "visualization_msgs/Marker",
        header=header,
        ns=marker.name,
        id=marker.number,
        type=int(marker.shape),
        action=action,
        pose=pose_to_ros(marker.position_m, turn),
        scale=point_to_ros("geometry_msgs/Vector3", marker.size_m),
        color=make("std_msgs/ColorRGBA", r=r, g=g, b=b, a=a),
        lifetime=make("builtin_interfaces/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[point_to_ros("geometry_msgs/Point", point) for point in marker.points_m],
        colors=[],
        texture_resource="",
        texture=make("sensor_msgs/CompressedImage", header=header_to_ros(0, ""), format="", data=nothing),
        uv_coordinates=[],
        text=marker.text,
        mesh_resource="",
        mesh_file=make("visualization_msgs/MeshFile", filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def _from_ros(ros: RosObject) -> Marker:
    return Marker(
        ros.ns,
        ros.id,
        MarkerShape(ros.type),
        point_from_ros(ros.pose.position),
        point_from_ros(ros.scale),
        (ros.color.r, ros.color.g, ros.color.b, ros.color.a),
        ros.text,
        np.array([point_from_ros(point) for point in ros.points], dtype=np.float64).reshape(-1, 3),
        float(yaw_from_quaternion(quaternion_from_ros(ros.pose.orientation))),
    )
