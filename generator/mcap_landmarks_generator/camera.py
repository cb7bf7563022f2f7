"""The camera: its intrinsics, when it takes images and from where."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mcap_landmarks.geometry.angles import wrap
from numpy.typing import NDArray

from mcap_landmarks_generator.clock import Delivered, Delivery, measurement_times, to_ns
from mcap_landmarks_generator.history import History, rotate
from mcap_landmarks_generator.mounts import Mount
from mcap_landmarks_generator.odometry import true_poses
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.sensor_specs import CameraSpec

Floats = NDArray[np.float64]

_TURN_OVER_NS = 8_000_000
_ROWS_NS = 4_000_000
"""A rolling shutter's views are so far apart: a step of physics, between which the robot moves evenly."""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera with square pixels; pixel (i, j) covers [i, i + 1) x [j, j + 1), the centre is at W/2, H/2."""

    width_px: int
    height_px: int
    focal_px: float

    @classmethod
    def of(cls, spec: CameraSpec) -> "Intrinsics":
        """From width, height and horizontal field of view."""
        focal_px = spec.width_px / 2 / np.tan(np.deg2rad(spec.field_of_view_deg) / 2)
        return cls(spec.width_px, spec.height_px, float(focal_px))

    def project(self, points: Floats) -> Floats:
        """Pixels (N, 2) of points (N, 3) in the optical frame, all in front of the camera."""
        centre = np.array([self.width_px / 2, self.height_px / 2])
        pixels: Floats = points[:, :2] / points[:, 2:] * self.focal_px + centre
        return pixels


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """From where to look: eye (3,), rotation world from optical (3, 3), time after the start."""

    eye_m: Floats
    world_from_optical: Floats
    time_s: float

    @classmethod
    def towards(cls, eye_m: Floats, target_m: Floats, upwards: Floats) -> "Viewpoint":
        """From an eye (3,) to a target (3,) at the start, with what lies `upwards` (3,) above it in the image."""
        forwards = (target_m - eye_m) / np.linalg.norm(target_m - eye_m)
        right = np.cross(forwards, upwards)
        right /= np.linalg.norm(right)
        return cls(eye_m, np.column_stack([right, np.cross(forwards, right), forwards]), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class ImageJob:
    """An image to take: the view in the middle of its exposure and readout, and how fast the camera turns then."""

    index: int
    stamp_ns: int
    log_time_ns: int
    view: Viewpoint
    turn_radps: float
    camera: int = 0
    """Which of the robot's cameras."""
    readout: tuple[Viewpoint, ...] = ()
    """Of a rolling shutter: views from the first row's time to the last one's, evenly spaced."""


class Camera:
    """The images of one camera of a simulated recording that are to be rendered, in order."""

    def __init__(self, mount: Mount, number: int, start_ns: int) -> None:
        """`number` says which of the robot's cameras it is."""
        spec = mount.spec
        self._mount, self._spec, self._number = mount, spec, number
        self._times = measurement_times(spec, draws(mount.seed, Stream.CAMERA_CLOCK))
        self._delivery = Delivery(spec, mount.seed, Stream.CAMERA_DELIVERY, start_ns)
        self._next_ns = next(self._times)
        self._index = 0
        self._readout_ns = to_ns(spec.rolling_shutter_s)

    def measure(self, history: History) -> Iterator[ImageJob]:
        """The images whose last row's time lies in the past."""
        while self._next_ns + self._readout_ns <= history.end_ns:
            if self._spec.when == "always" or (self._spec.when == "stops" and history.standing(self._next_ns)):
                delivered = self._delivery.of(self._next_ns, self._readout_ns)
                if delivered is not None:
                    yield self._job(history, self._next_ns, delivered)
                self._index += 1
            self._next_ns = next(self._times)

    def _job(self, history: History, time_ns: int, delivered: Delivered) -> ImageJob:
        middle_ns = time_ns + self._readout_ns // 2
        before, now = true_poses(history, np.array([max(0, middle_ns - _TURN_OVER_NS), middle_ns]))[:, 2]
        steps = -(-self._readout_ns // _ROWS_NS)
        row_times = [time_ns + self._readout_ns * step // steps for step in range(steps + 1)] if steps else []
        return ImageJob(
            index=self._index,
            stamp_ns=delivered.stamp_ns,
            log_time_ns=delivered.log_time_ns,
            view=self._view(history, middle_ns),
            turn_radps=float(wrap(now - before)) / (_TURN_OVER_NS / 1e9),
            camera=self._number,
            readout=tuple(self._view(history, row_ns) for row_ns in row_times),
        )

    def _view(self, history: History, time_ns: int) -> Viewpoint:
        at_ns = np.array([time_ns])
        orientation = history.orientations(at_ns)
        world_from_base = rotate(np.repeat(orientation, 3, axis=0), np.eye(3)).T
        eye = history.positions(at_ns)[0] + world_from_base @ self._mount.position_m
        return Viewpoint(eye, world_from_base @ self._mount.base_from_optical, time_ns / 1e9)
