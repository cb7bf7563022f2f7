"""Cameras: from points to pixels and back, with the distortions that ROS and OpenCV know."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.se2 import Array

_STEPS = 20
"""Newton's steps; cameras of 640 x 480 pixels with k1 of -0.3 come within 1e-12 pixels in five."""
_SLOPE_OVER = 1e-6
"""Numerical slopes are taken over so much of the image plane: the cube root of a double's precision is near it."""
_WIDEST = 10.0
"""The tangent of 84 degrees from the axis: no pinhole camera sees farther out."""
_PINHOLE, _FISHEYE = {"": 14, "plumb_bob": 8, "rational_polynomial": 14}, {"equidistant": 4, "fisheye": 4}
"""Models by ROS's names, and how many coefficients each may have."""
_PINHOLE_COUNT, _FISHEYE_COUNT = 14, 4


@dataclass(frozen=True, slots=True, eq=False)
class CameraModel:
    """A camera that looks along z, x to the right and y down.

    `intrinsics` is K (3, 3). `distortion` (n,) has k1, k2, p1, p2, k3, then k4 to k6 (rational), s1 to s4 (thin prism)
    and tau_x, tau_y (tilted sensor) as OpenCV's calibration has them; of a fisheye (`equidistant`) k1 to k4 of the
    polynomial in the angle from the axis (Kannala and Brandt 2006).
    """

    size_px: tuple[int, int]
    intrinsics: Array
    distortion: Array
    is_fisheye: bool
    limit: float = np.inf
    """The angle from the axis, or its tangent, up to which the distortion is good: farther out it folds back."""

    @classmethod
    def of(cls, name: str, size_px: tuple[int, int], intrinsics: Array, distortion: Array) -> "CameraModel":
        """A camera by the name of its distortion model, (width, height), K and the model's coefficients.

        Raises:
            RecordingError: the camera is not calibrated, or its model is none of these.
        """
        if not (np.isfinite(intrinsics).all() and intrinsics[0, 0] > 0 and intrinsics[1, 1] > 0):
            raise RecordingError("the CameraInfo has no focal length; calibrate the camera and record its CameraInfo")
        if not np.isfinite(distortion).all():
            raise RecordingError("the CameraInfo's distortion is not finite; calibrate the camera and record it again")
        if not distortion.any():
            return cls(size_px, intrinsics, np.zeros(_PINHOLE_COUNT), False)
        if name not in (*_PINHOLE, *_FISHEYE):
            known = ", ".join(repr(model) for model in (*_PINHOLE, *_FISHEYE) if model)
            raise RecordingError(f"the CameraInfo's distortion model is {name!r}; give one of {known}")
        is_fisheye = name in _FISHEYE
        coefficients = np.zeros(_FISHEYE_COUNT if is_fisheye else _PINHOLE_COUNT)
        given = _given(name, distortion)
        coefficients[: len(given)] = given
        camera = cls(size_px, intrinsics, coefficients, is_fisheye)
        return replace(camera, limit=camera._fold())

    def _fold(self) -> float:
        """Where, from the axis outwards, the distortion begins to fold back; infinite where it does not."""
        outwards = np.linspace(0.0, np.pi if self.is_fisheye else _WIDEST, 2000)
        bent = self._bent(outwards) if self.is_fisheye else self._distorted(outwards[:, None] * [1.0, 0.0])[:, 0]
        folds = np.flatnonzero(np.diff(bent) <= 0)
        return float(outwards[folds[0]]) if len(folds) else np.inf

    def project(self, points: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's frame; not a number where the camera cannot look.

        Where a calibration's distortion folds back, far outside the image, is where the camera cannot look either.
        """
        x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.is_fisheye:
                off = np.hypot(x, y)
                angle = np.arctan2(off, z)
                angle = np.where(angle <= self.limit, angle, np.nan)
                scale = np.where(off > 0, self._bent(angle) / np.where(off > 0, off, 1.0), 0.0)
                plane = np.stack([x * scale, y * scale], axis=-1)
            else:
                ahead = np.where((z > 0) & (np.hypot(x, y) <= self.limit * z), z, np.nan)
                plane = self._distorted(np.stack([x / ahead, y / ahead], axis=-1))
        k = self.intrinsics
        u = k[0, 0] * plane[..., 0] + k[0, 1] * plane[..., 1] + k[0, 2]
        return np.stack([u, k[1, 1] * plane[..., 1] + k[1, 2]], axis=-1)

    def rays(self, pixels_uv: ArrayLike) -> Array:
        """Unit vectors (..., 3) in the camera's frame through pixels (..., 2): what `project` undoes."""
        pixels, k = np.asarray(pixels_uv, dtype=np.float64), self.intrinsics
        y = (pixels[..., 1] - k[1, 2]) / k[1, 1]
        x = (pixels[..., 0] - k[0, 2] - k[0, 1] * y) / k[0, 0]
        plane = np.stack([x, y], axis=-1)
        if self.is_fisheye:
            bent = np.hypot(x, y)
            angle = self._straight(bent)
            sine = np.where(bent > 0, np.sin(angle) / np.where(bent > 0, bent, 1.0), 0.0)
            return np.stack([x * sine, y * sine, np.cos(angle)], axis=-1)
        straight = self._undistorted(plane)
        rays = np.concatenate([straight, np.ones_like(straight[..., :1])], axis=-1)
        unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return unit

    def _bent(self, angle: Array) -> Array:
        k1, k2, k3, k4 = self.distortion
        s = angle * angle
        bent: Array = angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
        return bent

    def _straight(self, bent: Array) -> Array:
        """The angle whose `_bent` this is, by Newton's method."""
        k1, k2, k3, k4 = self.distortion
        angle = np.minimum(bent, np.pi / 2)
        for _ in range(_STEPS):
            s = angle * angle
            slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
            angle = angle - (self._bent(angle) - bent) / np.where(np.abs(slope) > 0.1, slope, 0.1)
            angle = np.clip(angle, 0.0, min(self.limit, np.pi))
        return angle

    def _distorted(self, plane: Array) -> Array:
        if not self.distortion.any():
            return plane
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tilt_x, tilt_y = self.distortion
        x, y = plane[..., 0], plane[..., 1]
        s = x * x + y * y
        radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
        bent = np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s * (s1 + s * s2),
                y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s * (s3 + s * s4),
            ],
            axis=-1,
        )
        return _tilted(bent, tilt_x, tilt_y) if tilt_x or tilt_y else bent

    def _undistorted(self, plane: Array) -> Array:
        """The point whose `_distorted` this is, by Newton's method with numerical slopes."""
        if not self.distortion.any():
            return plane
        point, across, down = plane, np.array([_SLOPE_OVER, 0.0]), np.array([0.0, _SLOPE_OVER])
        for _ in range(_STEPS):
            off = self._distorted(point) - plane
            dx = (self._distorted(point + across) - self._distorted(point - across)) / (2 * _SLOPE_OVER)
            dy = (self._distorted(point + down) - self._distorted(point - down)) / (2 * _SLOPE_OVER)
            det = dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]
            det = np.where(np.abs(det) > 1e-3, det, 1e-3)
            step_x = (off[..., 0] * dy[..., 1] - off[..., 1] * dy[..., 0]) / det
            step_y = (off[..., 1] * dx[..., 0] - off[..., 0] * dx[..., 1]) / det
            point = point - np.stack([step_x, step_y], axis=-1)
        return point


def _tilted(plane: Array, about_x_rad: float, about_y_rad: float) -> Array:
    """Points (..., 2) of the image plane on a sensor that is tilted about x and then y (Louhichi et al. 2007)."""
    (sin_x, sin_y), (cos_x, cos_y) = np.sin([about_x_rad, about_y_rad]), np.cos([about_x_rad, about_y_rad])
    about_x = np.array([[1, 0, 0], [0, cos_x, sin_x], [0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0, -sin_y], [0, 1, 0], [sin_y, 0, cos_y]])
    turned = about_y @ about_x
    seen = np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 1]]) @ turned
    points = np.concatenate([plane, np.ones_like(plane[..., :1])], axis=-1) @ seen.T
    return np.asarray(points[..., :2] / points[..., 2:])


def _given(name: str, distortion: Array) -> Array:
    """The model's coefficients; more than it has may be given if these are zero."""
    count = {**_PINHOLE, **_FISHEYE}[name]
    if distortion[count:].any():
        raise RecordingError(f"the CameraInfo has {len(distortion)} coefficients of {name}; give {count}")
    return distortion[:count]
