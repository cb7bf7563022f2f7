"""What sensors sent, one at a time: images, scans and clouds of a log."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import echoes
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.vision.pixels import Rgb, rgb_from_message


@dataclass(frozen=True, slots=True, eq=False)
class LoggedItem:
    """When it was measured (`stamp_ns`, 0 where the log does not say) and logged, on which topic, in which frame."""

    stamp_ns: int
    log_time_ns: int
    topic: str
    frame_id: str

    @property
    def time(self) -> np.datetime64:
        """When it was measured, else when it was logged, in UTC."""
        return np.datetime64(self.stamp_ns or self.log_time_ns, "ns")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoggedImage(LoggedItem):
    """A camera's image, compressed or not; pictures of videos come decoded already."""

    message: CompressedImage | Image

    @property
    def pixels(self) -> Rgb:
        """The picture (H, W, 3), 8 bits each of red, green and blue; decoded each time that it is asked for.

        Raises:
            MessageError: the data are damaged, or no colour or grey picture.
        """
        return rgb_from_message(self.message)

    def __repr__(self) -> str:
        return f"<LoggedImage of {self.topic} at {self.time}, {len(self.message.data)} bytes>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoggedScan(LoggedItem):
    """One turn of a planar LiDAR: beam i of N at angles_rad[i] measured ranges_m[i], with intensities (N,) or (0,)."""

    angles_rad: Array
    ranges_m: NDArray[np.float32]
    intensities: NDArray[np.float32]
    range_min_m: float
    range_max_m: float

    @classmethod
    def of(cls, log_time_ns: int, topic: str, scan: LaserScan) -> "LoggedScan":
        """The item of a message."""
        angles_rad = scan.angle_min_rad + np.arange(len(scan.ranges_m), dtype=np.float64) * scan.angle_increment_rad
        limits_m = scan.range_min_m, scan.range_max_m
        place = scan.stamp_ns, log_time_ns, topic, scan.frame_id
        return cls(*place, angles_rad, scan.ranges_m, scan.intensities, *limits_m)

    @property
    def points_xy(self) -> Array:
        """Where the beams met something (M, 2), in metres in `frame_id`."""
        ranges_m = echoes(self.ranges_m, self.range_min_m, self.range_max_m)
        met = np.isfinite(ranges_m)
        angles_rad, ranges_m = self.angles_rad[met], ranges_m[met]
        return np.stack([ranges_m * np.cos(angles_rad), ranges_m * np.sin(angles_rad)], axis=1)

    def __repr__(self) -> str:
        return f"<LoggedScan of {self.topic} at {self.time}, {len(self.ranges_m)} beams>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoggedCloud(LoggedItem):
    """Points of a LiDAR or depth camera: points_m (N, 3) in `frame_id`, not finite where nothing came back."""

    points_m: NDArray[np.float32]

    @classmethod
    def of(cls, log_time_ns: int, topic: str, cloud: PointCloud2) -> "LoggedCloud":
        """The item of a message."""
        return cls(cloud.stamp_ns, log_time_ns, topic, cloud.frame_id, cloud.points_m)

    def __repr__(self) -> str:
        return f"<LoggedCloud of {self.topic} at {self.time}, {len(self.points_m)} points>"
