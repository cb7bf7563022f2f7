"""The cloud of a LiDAR of several rings, carried as PointCloud2."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from mcap_landmarks.messages.parts import header_to_ros, stamp_from_ros
from mcap_landmarks.messages.points import PointCloud2, cloud_to_ros, points_from_ros
from mcap_landmarks.messages.typestore import RosObject
from numpy.typing import NDArray

_LAYOUT = {"x": "<f4", "y": "<f4", "z": "<f4", "intensity": "<f4", "ring": "<i4", "t": "<i4"}


@dataclass(frozen=True, slots=True, eq=False)
class RingCloud:
    """The returns of one turn: points_m (N, 3) in `frame_id`, intensities (N,) of 255, rings (N,) from the lowest at 0,
    times_ns (N,) after the stamp, which is the first beam's."""

    ROS_TYPE: ClassVar[str] = PointCloud2.ROS_TYPE

    stamp_ns: int
    frame_id: str
    points_m: NDArray[np.float32]
    intensities: NDArray[np.float32]
    rings: NDArray[np.int32]
    times_ns: NDArray[np.int32]

    def to_ros(self) -> RosObject:
        """See `Message`; fields x, y, z, intensity, ring and t."""
        x, y, z = self.points_m.T
        columns = {"x": x, "y": y, "z": z, "intensity": self.intensities, "ring": self.rings, "t": self.times_ns}
        return cloud_to_ros(header_to_ros(self.stamp_ns, self.frame_id), columns)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        rows = points_from_ros(ros, _LAYOUT)
        points = np.stack([rows[name] for name in "xyz"], axis=1)
        stamp_ns = stamp_from_ros(ros.header.stamp)
        return cls(
            stamp_ns, ros.header.frame_id, points, *(np.array(rows[name]) for name in ("intensity", "ring", "t"))
        )
