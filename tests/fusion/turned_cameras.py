"""Cameras that look in several directions from one robot, and the boxes that each has of what stands around it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mcap_landmarks.fusion.camera_view import CameraView, SeenImage
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.transforms import Transform
from scipy.spatial.transform import Rotation

FORWARDS = np.array([-0.5, 0.5, -0.5, 0.5])


@dataclass(frozen=True, slots=True)
class TurnedCamera:
    """A camera with a focal length and a size in pixels, at a height in the base frame, that looks to a yaw."""

    frame: str
    yaw_deg: float
    height_m: float = 0.2
    focal_px: float = 530.5
    size_px: tuple[int, int] = (640, 480)

    @property
    def transform(self) -> Transform:
        """Where it is on the robot: a little ahead of the middle, in its own direction."""
        turned = Rotation.from_euler("z", self.yaw_deg, degrees=True)
        place = turned.apply([0.1, 0.0, self.height_m])
        return Transform(0, "base_footprint", self.frame, place, (turned * Rotation.from_quat(FORWARDS)).as_quat())

    @property
    def base_from_camera(self) -> Array:
        return frames.rigid(self.transform.translation_m, self.transform.rotation_xyzw)

    @property
    def matrix(self) -> Array:
        width, height = self.size_px
        return np.array([[self.focal_px, 0.0, width / 2], [0.0, self.focal_px, height / 2], [0.0, 0.0, 1.0]])

    @property
    def model(self) -> CameraModel:
        return CameraModel.of("", self.size_px, self.matrix, np.zeros(0))

    @property
    def info(self) -> CameraInfo:
        size, whole = (self.size_px[1], self.size_px[0]), np.column_stack([self.matrix, np.zeros(3)])
        return CameraInfo(1, self.frame, *size, "plumb_bob", np.zeros(5), self.matrix, np.eye(3), whole)

    def boxes(self, outlines: Sequence[Array]) -> Array:
        """Boxes (N, 4) around points (K, 3) in the base frame, cut by the image's edges; not a number where none is."""
        found = []
        for points in outlines:
            pixels = self.model.project(frames.apply(frames.inverse(self.base_from_camera), points))
            low, high = np.clip(pixels.min(axis=0), 0, self.size_px), np.clip(pixels.max(axis=0), 0, self.size_px)
            shows = np.isfinite(pixels).all() and (high > low).all()
            found.append([*low, *high] if shows else [np.nan] * 4)
        return np.array(found, dtype=np.float64).reshape(-1, 4)

    def detects(self, names: Sequence[str], outlines: Sequence[Array], stamp_ns: int, score: float = 0.8) -> Detections:
        """Detections of what shows."""
        boxes = self.boxes(outlines)
        shown = np.flatnonzero(np.isfinite(boxes).all(axis=1))
        options = tuple(((names[i], score),) for i in shown)
        return Detections(stamp_ns, self.frame, ("",) * len(shown), options, boxes[shown])

    def sees(self, names: Sequence[str], outlines: Sequence[Array], score: float = 0.8) -> SeenImage:
        """An image at the scan's time."""
        view = CameraView.at(self.model, self.base_from_camera, np.zeros(3), 0.0)
        return SeenImage(self.detects(names, outlines, 1, score), view)
