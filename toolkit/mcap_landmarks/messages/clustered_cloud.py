"""A cloud whose points are of objects, carried as PointCloud2."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.parts import header_to_ros, stamp_from_ros
from mcap_landmarks.messages.points import PointCloud2, cloud_to_ros, points_from_ros
from mcap_landmarks.messages.typestore import RosObject

_LAYOUT = {"x": "<f4", "y": "<f4", "z": "<f4", "height": "<f4", "cluster": "<i4"}
"""How the points of such a cloud are laid out; no other is one."""


@dataclass(frozen=True, slots=True, eq=False)
class ClusteredCloud:
    """The points of a scan that stand on the ground: points_m (N, 3) in the base frame `frame_id`, at the stamp.

    heights_m (N,) are above the local ground; clusters (N,) count from 0, points with the same number are of one.
    """

    ROS_TYPE: ClassVar[str] = PointCloud2.ROS_TYPE

    stamp_ns: int
    frame_id: str
    points_m: NDArray[np.float32]
    heights_m: NDArray[np.float32]
    clusters: NDArray[np.int32]

    def to_ros(self) -> RosObject:
        """See `Message`; fields x, y, z, height and cluster."""
        x, y, z = self.points_m.T
        columns = {"x": x, "y": y, "z": z, "height": self.heights_m, "cluster": self.clusters}
        return cloud_to_ros(header_to_ros(self.stamp_ns, self.frame_id), columns)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`.

        Raises:
            MessageError: there are no heights or clusters, or the data are shorter than they say.
        """
        if [field.name for field in ros.fields] != list(_LAYOUT) or ros.is_bigendian:
            raise MessageError(f"a point cloud with other fields than {', '.join(_LAYOUT)} has no clusters")
        rows = points_from_ros(ros, _LAYOUT)
        points = np.stack([rows[name] for name in "xyz"], axis=1)
        heights, clusters = np.array(rows["height"]), np.array(rows["cluster"])
        return cls(stamp_from_ros(ros.header.stamp), ros.header.frame_id, points, heights, clusters)
