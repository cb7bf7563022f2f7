"""Image, CompressedImage and CameraInfo."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.parts import Array, header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True, eq=False)
class CompressedImage:
    """An image as the bytes of a file; `format` is ROS's word for its kind, such as `jpeg`."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/CompressedImage"

    stamp_ns: int
    frame_id: str
    format: str
    data: bytes

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "sensor_msgs/CompressedImage",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            format=self.format,
            data=np.frombuffer(self.data, dtype=np.uint8),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(stamp_from_ros(ros.header.stamp), ros.header.frame_id, ros.format, ros.data.tobytes())


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An uncompressed image: `data` are `height_px` rows of `step` bytes in ROS's `encoding`."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/Image"

    stamp_ns: int
    frame_id: str
    height_px: int
    width_px: int
    encoding: str
    is_bigendian: bool
    step: int
    data: bytes

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "sensor_msgs/Image",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            height=self.height_px,
            width=self.width_px,
            encoding=self.encoding,
            is_bigendian=int(self.is_bigendian),
            step=self.step,
            data=np.frombuffer(self.data, dtype=np.uint8),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            ros.height,
            ros.width,
            ros.encoding,
            bool(ros.is_bigendian),
            ros.step,
            ros.data.tobytes(),
        )


@dataclass(frozen=True, slots=True)
class Region:
    """The part of the full sensor that the images of a CameraInfo show, in its pixels; all of it where sizes are 0."""

    x_px: int = 0
    y_px: int = 0
    width_px: int = 0
    height_px: int = 0
    do_rectify: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class CameraInfo:
    """Intrinsics of a camera: K (3, 3), distortion (n,) of `distortion_model`, R (3, 3), P (3, 4).

    Sizes, K and P are of the full sensor; its images show a `region` of that, `binning` pixels of the sensor as one,
    across and down, where 0 is 1. `of_rectified` is no part of the message: that its images are rectified ones already.
    """

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/CameraInfo"

    stamp_ns: int
    frame_id: str
    height_px: int
    width_px: int
    distortion_model: str
    distortion: Array
    intrinsics: Array
    rectification: Array
    projection: Array
    binning: tuple[int, int] = (0, 0)
    region: Region = Region()
    of_rectified: bool = False

    @property
    def is_calibrated(self) -> bool:
        """Whether K or P has a focal length; drivers send zeros where there is no calibration."""
        focal_px = self.intrinsics[[0, 1], [0, 1]], self.projection[[0, 1], [0, 1]]
        return any(bool((values > 0).all() and np.isfinite(values).all()) for values in focal_px)

    def to_ros(self) -> RosObject:
        """See `Message`."""
        region = make(
            "sensor_msgs/RegionOfInterest",
            x_offset=self.region.x_px,
            y_offset=self.region.y_px,
            height=self.region.height_px,
            width=self.region.width_px,
            do_rectify=self.region.do_rectify,
        )
        return make(
            "sensor_msgs/CameraInfo",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            height=self.height_px,
            width=self.width_px,
            distortion_model=self.distortion_model,
            d=np.ascontiguousarray(self.distortion),
            k=np.ascontiguousarray(self.intrinsics).ravel(),
            r=np.ascontiguousarray(self.rectification).ravel(),
            p=np.ascontiguousarray(self.projection).ravel(),
            binning_x=self.binning[0],
            binning_y=self.binning[1],
            roi=region,
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            ros.height,
            ros.width,
            ros.distortion_model,
            np.array(ros.d, dtype=np.float64),
            np.array(ros.k, dtype=np.float64).reshape(3, 3),
            np.array(ros.r, dtype=np.float64).reshape(3, 3),
            np.array(ros.p, dtype=np.float64).reshape(3, 4),
            (ros.binning_x, ros.binning_y),
            Region(ros.roi.x_offset, ros.roi.y_offset, ros.roi.width, ros.roi.height, bool(ros.roi.do_rectify)),
        )
