"""Which points of a cloud are of the thing in a box of an image: those in its frustum, by the clusters they are in."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.seen_things import Seen
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud

_BESIDE = 0.05
"""Share of the image's size that points may be beside it: objects go on behind its edges."""
_CORE = np.array([0.10, 0.05])
"""Share of a box's width and height that its core leaves out on each side: boxes are looser than what they show."""
_LOOSE = 0.08
"""Share of a box's size that an object may stick out of it."""
_GAP_M, _GAP_SHARE = 0.6, 0.01
"""Points of one thing are no farther apart along the view, and a share of the range more."""
_RANGE_SPREAD = 0.22
"""How far a range by a class's height is off, as a share of it: hidden feet, tall and low ones of a class."""
_HIDDEN_M, _SUNK_M = 0.5, 0.25
"""How much of a thing's lower end may be hidden by what stands before it, and how far below the ground around it a box
may end, as standard deviations: kerbs, shadows."""
_WHOLE = 0.2
"""What a piece counts, at least, of which most lies outside of the box: clusters may be of several things."""
_BEHIND_M = 12.0
"""A piece so far behind the nearest one counts e times less: what is farther is seen past an object or through it."""


@dataclass(frozen=True, slots=True, eq=False)
class CloudView:
    """What a camera sees of a cloud: N points above the ground of clusters that are in the image.

    points_xy (N, 2) in the base frame at the scan's time, heights_m (N,) above the local ground, whose own heights are
    floors_m (N,), clusters (N,), and rows (N,), which points of the cloud they are; at the image's time pixels (N, 2),
    not a number beside the image, and level ranges_m and bearings_rad (N,) from the camera.
    """

    points_xy: Array
    heights_m: Array
    floors_m: Array
    clusters: NDArray[np.int32]
    pixels: Array
    ranges_m: Array
    bearings_rad: Array
    rows: NDArray[np.intp]

    @classmethod
    def of(cls, cloud: ClusteredCloud, view: CameraView) -> Self:
        """What of a cloud is in an image, or of a cluster that is in it, or little beside it."""
        points = cloud.points_m.astype(np.float64)
        away = view.from_camera(points[:, :2])
        then = np.column_stack([away + view.base_from_camera[:2, 3], points[:, 2]])
        pixels = view.camera.project(frames.apply(frames.inverse(view.base_from_camera), then))
        beside = _BESIDE * np.array(view.camera.size_px)
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= -beside) & (pixels <= view.camera.size_px + beside)).all(axis=1)
        pixels[~inside] = np.nan
        shown = np.isin(cloud.clusters, cloud.clusters[inside])
        heights, away = cloud.heights_m[shown].astype(np.float64), away[shown]
        return cls(
            points[shown, :2],
            heights,
            points[shown, 2] - heights,
            cloud.clusters[shown],
            pixels[shown],
            np.hypot(away[:, 0], away[:, 1]),
            np.arctan2(away[:, 1], away[:, 0]),
            np.flatnonzero(shown),
        )

    @property
    def is_inside(self) -> NDArray[np.bool_]:
        """Which points (N,) are in the image."""
        inside: NDArray[np.bool_] = np.isfinite(self.pixels[:, 0])
        return inside

    def within(self, box_xyxy: Array) -> NDArray[np.bool_]:
        """Which points (N,) are in a box."""
        u, v = self.pixels[:, 0], self.pixels[:, 1]
        x1, y1, x2, y2 = box_xyxy.tolist()
        inside: NDArray[np.bool_] = (u >= x1) & (u <= x2) & (v >= y1) & (v <= y2)
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Points of one cluster in a box, no gap between them: their indices (K,), and how likely they are of its thing."""

    points: NDArray[np.intp]
    weight: float


@dataclass(frozen=True, slots=True)
class Upright:
    """What the upper and lower edge of a box say of its thing, not a number where they say nothing.

    `range_m` is where its height is that of its class. Its lower edge is seen from `camera_m` in the base frame at
    `slope`, with its sigma, and the class's lower end is between the heights `foot_m` above ground; nothing of a class
    is higher than `tallest_m`.
    """

    range_m: float
    tallest_m: float
    camera_m: float
    slope: float
    sigma_slope: float
    foot_m: tuple[float, float]

    def weight(self, away_m: float, floor_m: float) -> float:
        """How likely it is that the thing is so far away, on ground of a height: by Student's t, which never excludes.

        The lower end may be hidden, and the box end above it.
        """
        off = np.log(away_m / self.range_m) / _RANGE_SPREAD
        foot = self.camera_m + away_m * self.slope - floor_m
        over = max(foot - self.foot_m[1], 0.0) / np.hypot(_HIDDEN_M, away_m * self.sigma_slope)
        under = max(self.foot_m[0] - foot, 0.0) / np.hypot(_SUNK_M, away_m * self.sigma_slope)
        squares = [square for square in (off**2, over**2 + under**2) if np.isfinite(square)]
        return float(np.prod([(1 + square / 2) ** -1.5 for square in squares]))


def core(box_xyxy: Array) -> Array:
    """The box without its margins."""
    margin = _CORE * (box_xyxy[2:] - box_xyxy[:2])
    return np.concatenate([box_xyxy[:2] + margin, box_xyxy[2:] - margin])


def loose(box_xyxy: Array) -> Array:
    """The box and what may stick out of it."""
    margin = _LOOSE * (box_xyxy[2:] - box_xyxy[:2])
    return np.concatenate([box_xyxy[:2] - margin, box_xyxy[2:] + margin])


def pieces(view: CloudView, thing: Seen, is_free: NDArray[np.bool_], upright: Upright) -> list[Piece]:
    """The pieces that could be of a thing, the likeliest first; only points that `is_free` (N,) count.

    A piece is likely if it fills the core of the box, lies in it as a whole, and is as far away as the box's height and
    foot say; nothing of this excludes one.
    """
    inner = np.flatnonzero(view.within(core(thing.box_xyxy)) & is_free & (view.heights_m <= upright.tallest_m))
    if not len(inner):
        return []
    outer = view.within(loose(thing.box_xyxy))
    nearest = float(np.quantile(view.ranges_m[inner], 0.05))
    found = []
    for points in _parted(view, inner):
        away = float(np.median(view.ranges_m[points]))
        share = len(points) / len(inner)
        cluster = view.clusters == view.clusters[points[0]]
        near = cluster & (np.abs(view.ranges_m - away) < _BEHIND_M) & view.is_inside
        whole = float((near & outer).sum()) / float(near.sum())
        weight = share * (_WHOLE + (1 - _WHOLE) * whole) * upright.weight(away, float(np.median(view.floors_m[points])))
        weight *= np.exp(-max(away - nearest, 0.0) / _BEHIND_M)
        found.append(Piece(points, float(weight)))
    return sorted(found, key=lambda piece: -piece.weight)


def _parted(view: CloudView, points: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Points (K,) by cluster, and where one has a gap along the view, by what is before and behind it."""
    order = points[np.lexsort((view.ranges_m[points], view.clusters[points]))]
    away = view.ranges_m[order]
    breaks = np.diff(away) > _GAP_M + _GAP_SHARE * away[:-1]
    breaks |= np.diff(view.clusters[order]) != 0
    return list(np.split(order, np.flatnonzero(breaks) + 1))
