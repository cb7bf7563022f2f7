"""PointCloud2: only where its points are."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import MessageError
from toolkit.messages.parts import header_to_ros, make, stamp_from_ros

_KINDS = {7: "f4", 8: "f8"}
_FLOAT32 = 7


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud2:
    """Points of a LiDAR or depth camera: points_m (N, 3) in `frame_id`, not finite where there was no return."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/PointCloud2"

    stamp_ns: int
    frame_id: str
    points_m: NDArray[np.float32]

    def to_ros(self) -> Any:
        """See `Message`; one row of points with fields x, y and z."""
        points = np.ascontiguousarray(self.points_m, dtype="<f4")
        fields = [
            make("sensor_msgs/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
            for i, name in enumerate("xyz")
        ]
        return make(
            "sensor_msgs/PointCloud2",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points),
            data=points.reshape(-1).view(np.uint8),
            is_dense=bool(np.isfinite(points).all()),
        )

    @classmethod
    def from_ros(cls, ros: Any) -> Self:
        """See `Message`; whatever else a point has is left out.

        Raises:
            MessageError: there are no x, y and z, or the data are shorter than they say.
        """
        fields = {field.name: field for field in ros.fields}
        if not {"x", "y", "z"} <= fields.keys():
            raise MessageError(f"a point cloud with the fields {', '.join(fields) or 'none'} has no x, y and z")
        order, formats, offsets = ">" if ros.is_bigendian else "<", [], []
        for name in "xyz":
            kind = _KINDS.get(fields[name].datatype)
            if kind is None:
                raise MessageError(f"the {name} of a point cloud is of type {fields[name].datatype}, not a float")
            formats.append(order + kind)
            offsets.append(fields[name].offset)
        point: Any = {"names": ["x", "y", "z"], "formats": formats, "offsets": offsets, "itemsize": ros.point_step}
        rows = np.ascontiguousarray(ros.data).reshape(-1)
        if len(rows) < ros.height * ros.row_step or ros.row_step < ros.width * ros.point_step:
            raise MessageError(f"a point cloud of {ros.width} x {ros.height} points has {len(rows)} bytes only")
        rows = rows[: ros.height * ros.row_step].reshape(ros.height, -1)[:, : ros.width * ros.point_step]
        points = np.frombuffer(np.ascontiguousarray(rows).data, dtype=np.dtype(point))
        xyz = np.stack([np.asarray(points[name], dtype=np.float32) for name in "xyz"], axis=1)
        return cls(stamp_from_ros(ros.header.stamp), ros.header.frame_id, xyz)
