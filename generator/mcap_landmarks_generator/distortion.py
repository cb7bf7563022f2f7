"""Lenses that bend the image: distortion as ROS's CameraInfo tells it, and the wider pinhole image it is bent from."""

from dataclasses import dataclass, replace

import numpy as np
from mcap_landmarks.messages.images import CameraInfo
from numpy.typing import NDArray

from mcap_landmarks_generator.sensor_specs import CameraSpec

Floats = NDArray[np.float64]

WIDEST_RAD = np.deg2rad(80.0)
"""Farther from the axis a lens shows nothing: there a pinhole image would need a size without end (at 80 degrees it is
5.7 focal lengths from the middle), and the image circle of most fisheyes leaves the corners dark, too."""
_STEPS = 4000
"""Points of the table that tells where a lens folds back, and by which angles are found from radii: 0.02 degrees."""
_ROUNDS = 8
"""Rounds by which decentring is undone: each takes what is left times p1 or p2, which are hundredths at the most."""
_TINY = 1e-12
_COUNT = {"plumb_bob": 5, "equidistant": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A lens by its model and coefficients (5,) or (4,), between directions and pixels of an image.

    `plumb_bob` is Brown's (1966) with k1, k2, p1, p2, k3 in OpenCV's order, `equidistant` the polynomial in the angle
    from the axis with k1 to k4 of Kannala and Brandt (2006), as OpenCV's fisheye module has it.
    """

    size_px: tuple[int, int]
    focal_px: float
    model: str
    coefficients: Floats
    limit: float
    """Radius in the undistorted image plane (tangent of the angle from the axis) up to which it shows anything."""

    @classmethod
    def of(cls, spec: CameraSpec) -> "Lens":
        """The lens of a camera: at mid-height the image's edges are `field_of_view_deg` apart."""
        coefficients = np.zeros(_COUNT[spec.distortion_model])
        coefficients[: len(spec.distortion)] = spec.distortion
        size = (spec.width_px, spec.height_px)
        unit = cls(size, 1.0, spec.distortion_model, coefficients, np.tan(WIDEST_RAD))
        radii = np.tan(np.linspace(0.0, WIDEST_RAD, _STEPS))
        folds = np.flatnonzero(np.diff(unit.bent(radii)) <= 0)
        limit = float(radii[folds[0]] if len(folds) else radii[-1])
        edge = float(unit.bent(np.tan(np.deg2rad(spec.field_of_view_deg) / 2)))
        return replace(unit, focal_px=spec.width_px / 2 / edge, limit=limit)

    @property
    def is_pinhole(self) -> bool:
        """Whether it bends nothing."""
        return self.model == "plumb_bob" and not self.coefficients.any()

    def folds_inside(self, field_of_view_deg: float) -> bool:
        """Whether the model turns back before the image's corners, or before the edges of the field of view."""
        if self.limit >= np.tan(WIDEST_RAD) * (1 - _TINY):
            return False
        corner = float(np.hypot(*self.size_px)) / 2 / self.focal_px
        return self.limit < np.tan(np.deg2rad(field_of_view_deg) / 2) or float(self.bent(self.limit)) < corner

    def info(self, stamp_ns: int, frame_id: str) -> CameraInfo:
        """The message of an image with the given stamp."""
        width, height = self.size_px
        matrix = np.array([[self.focal_px, 0.0, width / 2], [0.0, self.focal_px, height / 2], [0.0, 0.0, 1.0]])
        projection = np.column_stack([matrix, np.zeros(3)])
        bends = (self.model, self.coefficients)
        return CameraInfo(stamp_ns, frame_id, height, width, *bends, matrix, np.eye(3), projection)

    def bent(self, radii: Floats | float) -> Floats:
        """Radii in the distorted image plane of radii in the undistorted one, without tangential distortion."""
        r = np.asarray(radii, np.float64)
        if self.model == "equidistant":
            angle = np.arctan(r)
            k1, k2, k3, k4 = self.coefficients
            s = angle * angle
            return np.asarray(angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))
        k1, k2, _, _, k3 = self.coefficients
        s = r * r
        return np.asarray(r * (1 + s * (k1 + s * (k2 + s * k3))))

    def pixels(self, plane: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 2) of the undistorted image plane; what lies beyond the limit is on it."""
        r = np.maximum(np.hypot(plane[..., 0], plane[..., 1]), _TINY)
        shown = np.minimum(r, self.limit)
        inside = plane * (shown / r)[..., None]
        bent = inside * (self.bent(shown) / shown)[..., None] + self._tangential(inside)
        return np.asarray(bent * self.focal_px + np.array(self.size_px) / 2)

    def plane(self, pixels_uv: Floats) -> Floats:
        """Points (N, 2) of the undistorted image plane that show at pixels (N, 2), not a number beyond the limit."""
        bent = (pixels_uv - np.array(self.size_px) / 2) / self.focal_px
        radii = np.tan(np.linspace(0.0, np.arctan(self.limit), _STEPS))
        bent_radii, angles = self.bent(radii), np.arctan(radii)
        found = bent
        for _ in range(_ROUNDS if self.model == "plumb_bob" else 1):
            radial = bent - self._tangential(found)
            r = np.hypot(radial[:, 0], radial[:, 1])
            # Angles grow evenly where tangents run away: between two points of the table they are nearly a line.
            angle = np.interp(r, bent_radii, angles, right=np.nan)
            found = radial * (np.tan(angle) / np.maximum(r, _TINY))[:, None]
        return np.asarray(found)

    def _tangential(self, plane: Floats) -> Floats:
        """What decentring adds (..., 2) to points of the undistorted image plane."""
        if self.model == "equidistant":
            return np.zeros_like(plane)
        _, _, p1, p2, _ = self.coefficients
        x, y = plane[..., 0], plane[..., 1]
        s = x * x + y * y
        return np.stack([2 * p1 * x * y + p2 * (s + 2 * x * x), p1 * (s + 2 * y * y) + 2 * p2 * x * y], axis=-1)

    def grid(self, fineness: int) -> Floats:
        """Points (h, w, 2) of the undistorted image plane in the middles of pixels that are `fineness` times finer."""
        width, height = (size * fineness for size in self.size_px)
        u, v = np.meshgrid((np.arange(width) + 0.5) / fineness, (np.arange(height) + 0.5) / fineness)
        return self.plane(np.stack([u, v], axis=-1).reshape(-1, 2)).reshape(height, width, 2)
