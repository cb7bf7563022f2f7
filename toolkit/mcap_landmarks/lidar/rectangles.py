"""Rectangles seen from above: the one that hugs points, and the one of a known size whose sides they lie on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import Cuboid
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array

_F = TypeVar("_F", bound=np.floating)

_TURNS = 30
"""Directions of the sides that are tried in a quarter turn: every 3 degrees, as well as a side can be told."""
_NEAREST_M = 0.05
"""Closer than this to a side is on it: surfaces are not flat (the criterion's d_0)."""
_MOST_POINTS = 150
"""More points than these, evenly thinned, say nothing new of where the sides are."""
_FEW_TURNS, _FEW_POINTS = 15, 60
"""The same where nobody knows yet what it is, and all clusters of a cloud are looked at."""
_TELLING = 20.0
"""So many points count at most: cars are round at their corners, in the same way for all points."""
_TRIM = 0.05
"""Share of points beyond each end of an extent: mirrors, and hits between two surfaces."""
_IMPOSSIBLE = 8.0
"""Directions that are less likely than the best by this logarithm are not looked at any further."""
_LENGTHS, _WIDTHS = np.array([-1.6, -0.8, 0.0, 0.8, 1.6]), np.array([-1.2, 0.0, 1.2])
"""Sizes that are tried, in standard deviations of the class's."""
_BEYOND_M = 0.12
"""How far points of an object may lie beyond the sides that it would have, as a standard deviation."""
_STRAY = 4.0
"""The logarithm of how unlikely it is at most that points beyond the sides are of something else."""
_NEAR, _FAR, _MIDST = np.log(0.85), np.log(0.10), np.log(0.05)
"""Logarithms of how often the end that is seen is the one that faces the LiDAR, is the other one because something
hides that, or neither."""
_ANY_END = np.log(1 / 3)
_FACE_M, _THROUGH = 0.5, np.log(0.001)
"""Points that lie within less of each other along an axis are on one face, which is hardly ever the one that looks away
from the LiDAR: that is only seen through windows. Points of the far end alone lie along another face."""
_HIDDEN, _HIDDEN_SIGMAS = 0.2, 6.0
"""How often an object goes on behind an edge of its box in the image, since something hides it, and how far."""
_SHORT, _SHORT_SIGMAS = 0.05, 6.0
"""How often an object ends before an edge of its box, and how far: boxes are of two things, or loose."""
_FLOOR_M = 0.06
"""How well a side is known at best: its points are on bumpers, wheels and doors."""


@dataclass(frozen=True, slots=True, eq=False)
class Rectangle:
    """A rectangle about `centre_xy` (2,), with the covariance (2, 2) of that in m^2.

    `yaw_rad` is the direction of its length, from -90 to 90 degrees: it has no front.
    """

    centre_xy: Array
    length_m: float
    width_m: float
    yaw_rad: float
    covariance: Array

    @property
    def corners(self) -> Array:
        """The corners (4, 2), counter-clockwise from the front left one."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        sides = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [self.length_m / 2, self.width_m / 2]
        corners: Array = self.centre_xy + sides @ np.array([[c, s], [-s, c]])
        return corners

    def holds(self, points_xy: Array, margin_m: float) -> NDArray[np.bool_]:
        """Which of the points (N, 2) lie in it, or not farther outside than a margin."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = (points_xy - self.centre_xy).T
        along, across = np.abs(c * x + s * y), np.abs(c * y - s * x)
        inside: NDArray[np.bool_] = (along <= self.length_m / 2 + margin_m) & (across <= self.width_m / 2 + margin_m)
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class BoxEdges:
    """The edges of a box in an image as bearings left and right in rad, about `camera_xy` (2,), with their sigma.

    The object may go on behind them by slack_rad (left, right): without end behind the image's own edge, and as far as
    something before the object reaches.
    """

    camera_xy: Array
    left_rad: float
    right_rad: float
    sigma_rad: float
    slack_rad: tuple[float, float]


def closeness(points_xy: Array, turns: int, most: int) -> tuple[Array, Array, Array]:
    """How well the sides of the rectangle that hugs points (..., N, 2) follow them, by its direction.

    Returns directions (T,) from 0 to 90 degrees, the mean closeness (..., T) of points to the nearest side, from 0 to
    1, and the extents (..., T, 2, 2), least and largest along and across. `turns` directions are looked at, and `most`
    points, evenly thinned. This is the search for an L-shape by the closeness criterion of Zhang, Xu, Dong and Dolan,
    Efficient L-shape fitting for vehicle detection using laser scanners, IV 2017 (algorithms 2 and 4), for all
    directions at once.
    """
    points = _thinned(points_xy, most)
    count = points.shape[-2]
    yaws: Array = np.arange(turns, dtype=np.float64) * (np.pi / 2 / turns)
    c, s = np.cos(yaws)[:, None], np.sin(yaws)[:, None]
    x, y = points[..., None, :, 0], points[..., None, :, 1]
    sides = np.stack([c * x + s * y, c * y - s * x], axis=-2)
    ordered = np.sort(sides, axis=-1)
    trim = int(_TRIM * count)
    low, high = ordered[..., trim, None], ordered[..., count - 1 - trim, None]
    below, above = np.abs(sides - low), np.abs(high - sides)
    nearer = np.square(below).sum(axis=-1) <= np.square(above).sum(axis=-1)
    off = np.where(nearer[..., None], below, above).min(axis=-2)
    close: Array = (_NEAREST_M / np.maximum(off, _NEAREST_M)).mean(axis=-1)
    return yaws, close, np.concatenate([low, high], axis=-1)


def hugging(things: Sequence[NDArray[np.floating]]) -> list[Rectangle]:
    """The rectangles that hug the points (N, 2) of things, their length the longer side.

    Covariances are those of the points' means. Things with as many points are looked at together, which is faster.
    """
    thinned = [_thinned(points_xy, _FEW_POINTS).astype(np.float64) for points_xy in things]
    counts = np.array([len(points) for points in thinned])
    found: dict[int, Rectangle] = {}
    for count in np.unique(counts):
        alike = np.flatnonzero(counts == count).tolist()
        yaws, close, ends = closeness(np.stack([thinned[i] for i in alike]), _FEW_TURNS, _FEW_POINTS)
        best = np.argmax(close, axis=-1)
        found.update({i: _hugging(float(yaws[k]), own[k]) for i, k, own in zip(alike, best, ends, strict=True)})
    return [found[i] for i in range(len(things))]


def _hugging(yaw: float, ends: Array) -> Rectangle:
    """The rectangle in a direction with extents (2, 2), least and largest along and across."""
    low, high = ends.T
    size, middle = high - low, (low + high) / 2
    c, s = np.cos(yaw), np.sin(yaw)
    centre = np.array([c * middle[0] - s * middle[1], s * middle[0] + c * middle[1]])
    turned = yaw if size[0] >= size[1] else yaw + np.pi / 2
    axes = np.array([[c, -s], [s, c]])
    covariance = axes @ np.diag(size**2 / 12 + _FLOOR_M**2) @ axes.T
    return Rectangle(centre, float(size.max()), float(size.min()), _half_turn(turned), covariance)


def completed(points_xy: Array, lidar_xy: Array, cuboid: Cuboid, edges: BoxEdges | None = None) -> Rectangle:
    """The rectangle of a known class that points (N, 2) lie on, seen by a LiDAR at `lidar_xy` (2,).

    Directions, lengths, widths, and which ends are seen are weighed against each other: by how close the points are to
    the sides, how usual the size is, how far points lie beyond it, and where the edges of a box in the image are. What
    is said of the centre is the mean of all of them, and their covariance: an end that is seen is sure, one that is not
    is as unsure as the size.
    """
    yaws, close, ends = closeness(points_xy, _TURNS, _MOST_POINTS)
    told = min(float(len(points_xy)), _TELLING)
    yaws, ends = np.concatenate([yaws, yaws + np.pi / 2]), np.concatenate([ends, _quarter_turned(ends)])
    fit = told * np.log(np.tile(close, 2) / close.max())
    kept = fit > -_IMPOSSIBLE
    yaws, ends, fit = yaws[kept], ends[kept], fit[kept]
    lidar = _along(yaws, np.broadcast_to(lidar_xy, (len(yaws), 2)))
    along, own_length = _placed(ends[:, 0], lidar[:, 0], cuboid.length_m, _LENGTHS)
    across, own_width = _placed(ends[:, 1], lidar[:, 1], cuboid.width_m, _WIDTHS)
    # Directions, then length and its end (I), then width and its end (J).
    log_weight = fit[:, None, None] + along.log_weight[:, :, None] + across.log_weight[:, None, :]
    middle = np.stack(np.broadcast_arrays(along.middle[:, :, None], across.middle[:, None, :]), axis=-1)
    c, s = np.cos(yaws)[:, None, None], np.sin(yaws)[:, None, None]
    centre = np.stack([c * middle[..., 0] - s * middle[..., 1], s * middle[..., 0] + c * middle[..., 1]], axis=-1)
    half = np.stack(np.broadcast_arrays(own_length[None, :, None], own_width[None, None, :]), axis=-1) / 2
    half = np.broadcast_to(half, centre.shape)
    if edges is not None:
        log_weight = log_weight + _seen_between(edges, centre, half, (c, s))
    return _mean(log_weight, centre, half, np.broadcast_to(yaws[:, None, None], log_weight.shape))


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """Where the middle of an object is along one axis (T, I) and the logarithm of how likely that is (T, I)."""

    middle: Array
    log_weight: Array


def _placed(ends: Array, lidar: Array, measure_m: tuple[float, float], steps: Array) -> tuple[_Ends, Array]:
    """What sizes, and what ends that points (T, 2) lie between are seen, make of one axis; the sizes (I,)."""
    sizes = np.repeat(np.maximum(measure_m[0] + steps * measure_m[1], 0.1), 3)
    usual = np.repeat(-(steps**2) / 2, 3)
    low, high = ends[:, :1], ends[:, 1:]
    which = np.tile([0, 1, 2], len(steps))
    middle = np.where(which == 0, low + sizes / 2, np.where(which == 1, high - sizes / 2, (low + high) / 2))
    before, behind = lidar[:, None] < low, lidar[:, None] > high
    facing = np.where(before, which == 0, which == 1)
    away = np.where(high - low < _FACE_M, _THROUGH, _FAR)
    log_end = np.where(before | behind, np.where(facing, _NEAR, np.where(which == 2, _MIDST, away)), _ANY_END)
    beyond = np.maximum(high - low - sizes, 0.0) / _BEYOND_M
    return _Ends(middle, usual + log_end - np.minimum(beyond**2 / 2, _STRAY)), sizes


def _seen_between(edges: BoxEdges, centre: Array, half: Array, axis: tuple[Array, Array]) -> Array:
    """The logarithm of how likely objects (...) are to be seen between the edges of a box."""
    c, s = axis
    # About the direction of one of them, so that no bearing is near the seam of half a turn.
    about = np.arctan2(*(centre.reshape(-1, 2)[0] - edges.camera_xy)[::-1])
    ahead = np.array([np.cos(about), np.sin(about)])
    away = centre - edges.camera_xy
    middle = away @ ahead, away @ np.array([-ahead[1], ahead[0]])
    along = half[..., 0] * (c * ahead[0] + s * ahead[1]), half[..., 0] * (s * ahead[0] - c * ahead[1])
    across = half[..., 1] * (c * ahead[1] - s * ahead[0]), half[..., 1] * (c * ahead[0] + s * ahead[1])
    corners = np.stack(
        [
            np.arctan2(middle[1] + i * along[1] + j * across[1], middle[0] + i * along[0] + j * across[0])
            for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1))
        ]
    )
    left, right = (
        corners.max(axis=0) - wrap(edges.left_rad - about),
        wrap(edges.right_rad - about) - corners.min(axis=0),
    )
    total = np.zeros(centre.shape[:-1])
    for off, slack_rad in zip((left, right), edges.slack_rad, strict=True):
        inwards = (np.minimum(off, 0.0) + np.maximum(off - slack_rad, 0.0)) / edges.sigma_rad
        hidden = np.where(inwards > 0, _HIDDEN / _HIDDEN_SIGMAS, _SHORT / _SHORT_SIGMAS)
        tail = np.exp(-np.abs(inwards) / np.where(inwards > 0, _HIDDEN_SIGMAS, _SHORT_SIGMAS))
        seen = (1 - _HIDDEN - _SHORT) / np.sqrt(2 * np.pi) * np.exp(-(inwards**2) / 2)
        total = total + np.log(seen + hidden * tail)
    return total


def _mean(log_weight: Array, centre: Array, half: Array, yaw: Array) -> Rectangle:
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    best = np.unravel_index(int(np.argmax(weight)), weight.shape)
    mean = np.einsum("tij,tijk->k", weight, centre)
    off = centre - mean
    covariance = np.einsum("tij,tijk,tijl->kl", weight, off, off) + _FLOOR_M**2 * np.eye(2)
    # Length and direction are those of what is likely and lies the same way as the best.
    alike = weight * (np.abs(wrap(yaw - yaw[best])) < np.pi / 4)
    length, width = 2 * np.einsum("tij,tijk->k", alike, half) / alike.sum()
    turned = float(yaw[best] + (alike * wrap(yaw - yaw[best])).sum() / alike.sum())
    return Rectangle(mean, float(length), float(width), _half_turn(turned), covariance)


def _along(yaws: Array, points_xy: Array) -> Array:
    """Points (T, 2) along and across directions (T,)."""
    c, s = np.cos(yaws), np.sin(yaws)
    return np.stack([c * points_xy[:, 0] + s * points_xy[:, 1], c * points_xy[:, 1] - s * points_xy[:, 0]], axis=1)


def _quarter_turned(ends: Array) -> Array:
    """Extents (T, 2, 2) along and across, seen from directions a quarter turn on."""
    return np.stack([ends[:, 1], -ends[:, 0, ::-1]], axis=1)


def _half_turn(yaw_rad: float) -> float:
    """A direction from -90 to 90 degrees: a rectangle has no front."""
    return float((yaw_rad + np.pi / 2) % np.pi - np.pi / 2)


def _thinned(points_xy: NDArray[_F], most: int) -> NDArray[_F]:
    """At most so many of points (..., N, 2), evenly spread over their order."""
    count = points_xy.shape[-2]
    if count <= most:
        return points_xy
    return points_xy[..., np.linspace(0, count - 1, most).round().astype(np.intp), :]
