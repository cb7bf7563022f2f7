"""A camera on the robot: where things of a scan are to it, at the moment of its image."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.fusion.camera_info import in_image
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.frames import apply
from mcap_landmarks.geometry.se2 import Array, exp, inverse, transform_points
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo

_CLOCK_S, _VELOCITY_SHARE = 0.01, 0.1
"""Stamps of camera and odometry agree to so much, and between a scan and an image the robot turns as odometry says to
such a share: assumed, for want of logs that tell; 10 ms is an exposure in dim light."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A camera and its image: base_from_camera (4, 4), and scan_from_image (3,), how the base moved between the two.

    `heading_sigma_rad` is how unsure that turn is.
    """

    camera: CameraModel
    base_from_camera: Array
    scan_from_image: Array
    heading_sigma_rad: float

    @classmethod
    def at(cls, camera: CameraModel, base_from_camera: Array, velocity: Array, late_s: float) -> Self:
        """The view of an image taken so much later than the scan, at the base's velocity (3,)."""
        step = exp(velocity * late_s)
        unsure = abs(velocity[2]) * _CLOCK_S + _VELOCITY_SHARE * abs(step[2])
        return cls(camera, base_from_camera, step, float(unsure))

    def from_camera(self, points_xy: Array) -> Array:
        """Points (N, 2) of the base at the scan's time, as places (N, 2) from the camera at the image's time."""
        return transform_points(inverse(self.scan_from_image), points_xy) - self.base_from_camera[:2, 3]

    def shows(self, point_xy: Array, half_width_m: float, height_m: float) -> bool:
        """Whether the image has the whole width of something at a place (2,), at a height above ground."""
        place = self.from_camera(point_xy[None])[0]
        distance = float(np.hypot(*place))
        if distance <= half_width_m:
            return False
        across = half_width_m / distance * np.array([-place[1], place[0]])
        sides = self.base_from_camera[:2, 3] + place + np.array([[1.0], [0.0], [-1.0]]) * across
        points = np.column_stack([sides, np.full(3, height_m)])
        pixels = self.camera.project(apply(frames.inverse(self.base_from_camera), points))
        width, height = self.camera.size_px
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0) & (pixels <= [width, height])
        return bool(inside.all()) and bool(pixels[0, 0] < pixels[1, 0] < pixels[2, 0])


class SeenImage(NamedTuple):
    """The detections in an image, and the camera's view of the scan that it lies beside."""

    detections: Detections
    view: CameraView


def camera_from_info(info: CameraInfo, *, rectified: bool | None) -> CameraModel:
    """The camera of a CameraInfo, or of the images that were `rectified` with it; None: as it says itself.

    Raises:
        RecordingError: see `CameraModel.of` and `in_image`.
    """
    info = in_image(info)
    width, height = info.width_px or 2 * info.intrinsics[0, 2], info.height_px or 2 * info.intrinsics[1, 2]
    size = (int(width), int(height))
    if info.of_rectified if rectified is None else rectified:
        if not info.projection[0, 0] > 0:
            raise RecordingError(
                "the CameraInfo has no P, which counts for rectified images; calibrate the camera, or set "
                "fuse.rectified=false if they are not rectified"
            )
        return CameraModel.of("", size, info.projection[:, :3], np.zeros(0))
    return CameraModel.of(info.distortion_model, size, info.intrinsics, info.distortion)
