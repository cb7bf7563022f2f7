"""Boxes in an image as directions from the robot, and how well scan objects explain them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points

OFF_MIDDLE = 0.2
"""How far off the middle of its box an object stands, as a share of half the width: arms, poses, hidden sides. In the
generator's log `cluttered` (seed 3) the RMS is 0.11 for objects that nothing hides, 0.25 for all."""
_EDGE_MARGIN_PX = 2.5
"""Edges so near the image's are cut by it: a little more than `edge_px`, the default of what edges are sure to."""
_MEASURED_M = 0.05
"""Heights and widths are sure to so much at best: ground is uneven, and a robot pitches by a degree or so."""
_NARROWED, _HEIGHT_SPREAD = 0.35, 0.07
"""What hides an object narrows it by such a share, and sizes go beyond their usual range by such a share (statures of
adults have standard deviations of 4 %); standard deviations."""
_HIDDEN_FOOT_M = 0.25
"""What stands before an object, such as a kerb or a bag, hides its foot so high; a standard deviation."""
_BOTH_EDGES = 1.4
"""The square root of two, about: errors of two edges add up."""
_AT_LEAST_M = 0.05
"""No object is nearer to the camera, which divides by that."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxGeometry:
    """M boxes as the camera sees them, in the base frame at the image's time.

    Bearings left, right and middle (M,) in rad about the camera, and half the angle between left and right; slopes top
    and bottom (M,), height over distance; sigma_rad and sigma_slope (M,) of an edge; `cut` (M, 4): left, top, right,
    bottom is the image's edge; slack_rad (M, 2): how far the object may go on behind the left and the right edge, which
    is endless behind the image's edge, and as far as that reaches behind something that stands before it.
    """

    left: Array
    right: Array
    middle: Array
    half: Array
    top: Array
    bottom: Array
    sigma_rad: Array
    sigma_slope: Array
    cut: NDArray[np.bool_]
    slack_rad: Array

    def covers(self, bearing_rad: float, margin_rad: float, of: NDArray[np.bool_]) -> bool:
        """Whether any of some boxes, by a mask (M,), reaches across a bearing, give or take a margin."""
        off = np.abs(wrap(bearing_rad - self.middle))
        return bool((of & (off <= self.half + margin_rad)).any())


def box_geometry(view: CameraView, boxes_xyxy: Array, config: FuseConfig) -> BoxGeometry:
    """Boxes (M, 4) in pixels as directions."""
    x1, y1, x2, y2 = boxes_xyxy.T
    middle_x, middle_y = (x1 + x2) / 2, (y1 + y2) / 2
    columns = np.stack([x1, x2, middle_x, middle_x, middle_x], axis=1)
    rows = np.stack([middle_y, middle_y, middle_y, y1, y2], axis=1)
    rays = view.camera.rays(np.stack([columns, rows], axis=-1)) @ view.base_from_camera[:3, :3].T
    bearings = np.arctan2(rays[..., 1], rays[..., 0])
    slopes = rays[..., 2] / np.hypot(rays[..., 0], rays[..., 1])
    wide, high = np.maximum(x2 - x1, 1.0), np.maximum(y2 - y1, 1.0)
    across = wrap(bearings[:, 0] - bearings[:, 1])
    slope_per_px = np.abs(slopes[:, 3] - slopes[:, 4]) / high
    width, height = view.camera.size_px
    ends = np.stack([x1, y1, width - x2, height - y2], axis=1)
    return BoxGeometry(
        left=bearings[:, 0],
        right=bearings[:, 1],
        middle=bearings[:, 1] + across / 2,
        half=np.abs(across) / 2,
        top=slopes[:, 3],
        bottom=slopes[:, 4],
        sigma_rad=np.abs(across) / wide * np.hypot(config.edge_px, config.edge_share * wide),
        sigma_slope=slope_per_px * np.hypot(config.edge_px, config.edge_share * high),
        cut=ends <= _EDGE_MARGIN_PX,
        slack_rad=_slack(boxes_xyxy, bearings[:, :2], ends[:, [0, 2]] <= _EDGE_MARGIN_PX),
    )


def _slack(boxes_xyxy: Array, bearings: Array, is_cut: NDArray[np.bool_]) -> Array:
    """How far in rad what is in boxes may go on behind their left and right edges (M, 2), at some bearings (M, 2).

    A box whose lower edge is lower stands before another one, whose edge it hides if that is within it.
    """
    x1, y1, x2, y2 = boxes_xyxy.T
    before = (y2[None, :] > y2[:, None]) & (y1[None, :] < y2[:, None])
    slack = np.where(is_cut, np.inf, 0.0)
    for side, edge in enumerate((x1, x2)):
        hides = before & (edge[:, None] >= x1[None, :]) & (edge[:, None] <= x2[None, :])
        reach = np.abs(wrap(bearings[None, :, side] - bearings[:, None, side]))
        slack[:, side] = np.maximum(slack[:, side], np.where(hides, reach, 0.0).max(axis=1, initial=0.0))
    return slack


def misfits(
    view: CameraView, boxes: BoxGeometry, box: int, centres: tuple[Array, Array], size: Size, config: FuseConfig
) -> tuple[Array, Array, Array]:
    """How badly one box fits objects with centres (N, 2) and covariances (N, 2, 2), if they have a size.

    Returns how far to the left of the box they are (N,), in sigmas, those sigmas in rad (N,), and chi-squares (N,) of
    height and width.
    """
    places = view.from_camera(centres[0])
    distance = np.maximum(np.hypot(places[:, 0], places[:, 1]), _AT_LEAST_M)
    across = np.stack([-places[:, 1], places[:, 0]], axis=1) / distance[:, None]
    turned = transform_points(np.array([0.0, 0.0, float(view.scan_from_image[2])]), across)
    spread = np.einsum("ni,nij,nj->n", turned, centres[1], turned)
    bearing = np.arctan2(places[:, 1], places[:, 0])
    own = np.hypot(config.bearing_sigma_rad, view.heading_sigma_rad) ** 2 + (spread + config.lateral_m**2) / distance**2
    aside, sigma = _sideways(boxes, box, bearing, distance, own, size)
    return aside, sigma, _upright(boxes, box, distance, view.base_from_camera[2, 3], size)


def _sideways(
    boxes: BoxGeometry, box: int, bearing: Array, distance: Array, variance: Array, size: Size
) -> tuple[Array, Array]:
    """How far to the left of a box objects are (N,), in sigmas, and those sigmas in rad (N,)."""
    left_cut, _, right_cut, _ = boxes.cut[box].tolist()
    off = wrap(bearing - boxes.middle[box])
    half = float(boxes.half[box])
    if left_cut and right_cut:
        return np.where(np.abs(off) <= half, 0.0, off / np.sqrt(variance)), np.sqrt(variance) + half
    if not (left_cut or right_cut):
        variance = variance + boxes.sigma_rad[box] ** 2 / 2 + (OFF_MIDDLE * half) ** 2
        return np.asarray(off / np.sqrt(variance)), np.sqrt(variance)
    # Its middle is half of the object's width from the free edge, and the object is at least as wide as what shows.
    narrow, wide = (np.arctan(width / 2 / distance) for width in size.width_m)
    from_edge = half + (off if left_cut else -off)
    nearest = np.maximum(narrow, half)
    beyond = from_edge - np.clip(from_edge, nearest, np.maximum(nearest, wide))
    towards = 1.0 if left_cut else -1.0
    sigma = np.sqrt(variance + boxes.sigma_rad[box] ** 2)
    return np.asarray(towards * beyond / sigma), sigma


def _upright(boxes: BoxGeometry, box: int, distance: Array, camera_m: float, size: Size) -> Array:
    """Chi-squares (N,) of what an object at distances (N,) in a box would measure, against a size."""
    left_cut, top_cut, right_cut, bottom_cut = boxes.cut[box].tolist()
    unsure = np.hypot(distance * boxes.sigma_slope[box], _MEASURED_M)
    top = camera_m + distance * boxes.top[box]
    foot = camera_m + distance * boxes.bottom[box]
    width = 2 * distance * np.tan(boxes.half[box])
    blurred = np.hypot(2 * distance * boxes.sigma_rad[box], _MEASURED_M)
    total = _over(top, size.top_m[1], unsure + _HEIGHT_SPREAD * size.top_m[1]) + _over(width, size.width_m[1], blurred)
    if not top_cut:
        total = total + _over(size.top_m[0], top, unsure + _HEIGHT_SPREAD * size.top_m[0])
    if not bottom_cut:
        total = total + _over(size.foot_m[0], foot, unsure)
    if not (top_cut or bottom_cut):
        least, most = size.tall_m
        both = _BOTH_EDGES * unsure
        total = total + _over(top - foot, most, both) + _over(least, top - foot, both + _HIDDEN_FOOT_M)
    total = total + _over(foot, size.foot_m[1], unsure + _HIDDEN_FOOT_M)
    if not (left_cut or right_cut):
        total = total + _over(size.width_m[0], width, blurred + _NARROWED * size.width_m[0])
    return total


def _over(value: Array | float, limit: Array | float, sigma: Array) -> Array:
    """Squared excess over a limit, in sigmas."""
    return np.asarray((np.maximum(np.asarray(value) - limit, 0.0) / sigma) ** 2)
