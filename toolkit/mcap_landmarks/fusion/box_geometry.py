"""Boxes in an image as directions from the robot, and how well scan objects explain them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import Size
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.frames import apply
from mcap_landmarks.geometry.se2 import Array, exp, inverse, transform_points

_EDGE_MARGIN_PX = 2.5
_CLOCK_S = 0.01
_DEPTH_M = 0.05
_NARROWED, _HEIGHT_SPREAD = 0.35, 0.07
_HIDDEN_FOOT_M = 0.25
"""An object's foot may be hidden by what stands before it, so high, give or take."""
_OFF_MIDDLE = 0.2
"""How far off the middle of its box an object stands, as a share of half the width: arms, poses, hidden sides."""


@dataclass(frozen=True, slots=True)
class BoxError:
    """Standard deviations: of a box's edge, in pixels and as a share of its size; of bearings; of places across."""

    edge_px: float
    edge_share: float
    bearing_rad: float
    lateral_m: float


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A camera on the robot: its model, base_from_camera (4, 4) and scan_from_image (3,), the base's way meanwhile."""

    camera: CameraModel
    base_from_camera: Array
    scan_from_image: Array
    turned_rad: float

    @classmethod
    def at(cls, camera: CameraModel, base_from_camera: Array, velocity: Array, late_s: float) -> "View":
        """The view of an image taken so much later than the scan, at the base's velocity (3,)."""
        step = exp(velocity * late_s)
        unsure = abs(velocity[2]) * _CLOCK_S + 0.1 * abs(step[2])
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


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """M boxes as the camera sees them, in the base frame at the image's time.

    Bearings left, right and middle (M,) in rad about the camera; slopes top and bottom (M,), height over distance;
    sigma_rad and sigma_slope (M,) of an edge; `cut` (M, 4): left, top, right, bottom is the image's edge.
    """

    left: Array
    right: Array
    middle: Array
    top: Array
    bottom: Array
    sigma_rad: Array
    sigma_slope: Array
    cut: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.middle)

    def covers(self, bearing_rad: float, margin_rad: float, of: NDArray[np.bool_]) -> bool:
        """Whether any of some boxes, by a mask (M,), reaches across a bearing, give or take a margin."""
        half = np.abs(wrap(self.left - self.right)) / 2 + margin_rad
        return bool((of & (np.abs(wrap(bearing_rad - self.middle)) <= half)).any())


def sights_of(view: View, boxes_xyxy: Array, error: BoxError) -> Sights:
    """Boxes (M, 4) in pixels as directions."""
    x1, y1, x2, y2 = boxes_xyxy.T
    middle_x, middle_y = (x1 + x2) / 2, (y1 + y2) / 2
    columns = np.stack([x1, x2, middle_x, middle_x, middle_x], axis=1)
    rows = np.stack([middle_y, middle_y, middle_y, y1, y2], axis=1)
    rays = view.camera.rays(np.stack([columns, rows], axis=-1)) @ view.base_from_camera[:3, :3].T
    bearings = np.arctan2(rays[..., 1], rays[..., 0])
    slopes = rays[..., 2] / np.hypot(rays[..., 0], rays[..., 1])
    wide, high = np.maximum(x2 - x1, 1.0), np.maximum(y2 - y1, 1.0)
    rad_per_px = np.abs(wrap(bearings[:, 0] - bearings[:, 1])) / wide
    slope_per_px = np.abs(slopes[:, 3] - slopes[:, 4]) / high
    width, height = view.camera.size_px
    ends = np.stack([x1, y1, width - x2, height - y2], axis=1)
    return Sights(
        left=bearings[:, 0],
        right=bearings[:, 1],
        middle=bearings[:, 1] + wrap(bearings[:, 0] - bearings[:, 1]) / 2,
        top=slopes[:, 3],
        bottom=slopes[:, 4],
        sigma_rad=rad_per_px * np.hypot(error.edge_px, error.edge_share * wide),
        sigma_slope=slope_per_px * np.hypot(error.edge_px, error.edge_share * high),
        cut=ends <= _EDGE_MARGIN_PX,
    )


def misfits(
    view: View, sights: Sights, box: int, centres: tuple[Array, Array], size: Size, error: BoxError
) -> tuple[Array, Array, Array]:
    """How badly one box fits objects with centres (N, 2) and covariances (N, 2, 2), if they have a size.

    Returns how far to the left of the box they are (N,), in sigmas, those sigmas in rad (N,), and chi-squares (N,) of
    height and width.
    """
    places = view.from_camera(centres[0])
    distance = np.maximum(np.hypot(places[:, 0], places[:, 1]), 0.05)
    across = np.stack([-places[:, 1], places[:, 0]], axis=1) / distance[:, None]
    turned = transform_points(np.array([0.0, 0.0, float(view.scan_from_image[2])]), across)
    spread = np.einsum("ni,nij,nj->n", turned, centres[1], turned)
    bearing = np.arctan2(places[:, 1], places[:, 0])
    own = np.hypot(error.bearing_rad, view.turned_rad) ** 2 + (spread + error.lateral_m**2) / distance**2
    sideways, sigma = _sideways(sights, box, bearing, distance, own, size)
    return sideways, sigma, _upright(sights, box, distance, view.base_from_camera[2, 3], size)


def _sideways(
    sights: Sights, box: int, bearing: Array, distance: Array, variance: Array, size: Size
) -> tuple[Array, Array]:
    """How far to the left of a box objects are (N,), in sigmas, and those sigmas in rad (N,)."""
    left_cut, _, right_cut, _ = sights.cut[box].tolist()
    off = wrap(bearing - sights.middle[box])
    half = abs(float(wrap(sights.left[box] - sights.right[box]))) / 2
    if left_cut and right_cut:
        return np.where(np.abs(off) <= half, 0.0, off / np.sqrt(variance)), np.sqrt(variance) + half
    if not (left_cut or right_cut):
        variance = variance + sights.sigma_rad[box] ** 2 / 2 + (_OFF_MIDDLE * half) ** 2
        return np.asarray(off / np.sqrt(variance)), np.sqrt(variance)
    # Its middle is half of the object's width from the free edge, and the object is at least as wide as what shows.
    narrow, wide = (np.arctan(width / 2 / distance) for width in size.width_m)
    from_edge = half + (off if left_cut else -off)
    nearest = np.maximum(narrow, half)
    beyond = from_edge - np.clip(from_edge, nearest, np.maximum(nearest, wide))
    towards = 1.0 if left_cut else -1.0
    sigma = np.sqrt(variance + sights.sigma_rad[box] ** 2)
    return np.asarray(towards * beyond / sigma), sigma


def _upright(sights: Sights, box: int, distance: Array, camera_m: float, size: Size) -> Array:
    left_cut, top_cut, right_cut, bottom_cut = sights.cut[box].tolist()
    unsure = np.hypot(distance * sights.sigma_slope[box], _DEPTH_M)
    top = camera_m + distance * sights.top[box]
    foot = camera_m + distance * sights.bottom[box]
    width = 2 * distance * np.tan(np.abs(wrap(sights.left[box] - sights.right[box])) / 2)
    blurred = np.hypot(2 * distance * sights.sigma_rad[box], _DEPTH_M)
    total = _over(top, size.top_m[1], unsure + _HEIGHT_SPREAD * size.top_m[1]) + _over(width, size.width_m[1], blurred)
    if not top_cut:
        total = total + _over(size.top_m[0], top, unsure + _HEIGHT_SPREAD * size.top_m[0])
    if not bottom_cut:
        total = total + _over(size.foot_m[0], foot, unsure)
    if not (top_cut or bottom_cut):
        least, most = size.tall_m
        total = total + _over(top - foot, most, 1.4 * unsure) + _over(least, top - foot, 1.4 * unsure + _HIDDEN_FOOT_M)
    total = total + _over(foot, size.foot_m[1], unsure + _HIDDEN_FOOT_M)
    if not (left_cut or right_cut):
        total = total + _over(size.width_m[0], width, blurred + _NARROWED * size.width_m[0])
    return total


def _over(value: Array | float, limit: Array | float, sigma: Array) -> Array:
    """Squared excess over a limit, in sigmas."""
    return np.asarray((np.maximum(np.asarray(value) - limit, 0.0) / sigma) ** 2)
