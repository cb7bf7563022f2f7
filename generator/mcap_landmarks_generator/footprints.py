"""What space objects take, as convex outlines by height, to tell whether things get in each other's way."""

import functools
from itertools import pairwise

import numpy as np
from mcap_landmarks.geometry.se2 import transform_points
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.layout import PlacedObject

Floats = NDArray[np.float64]

_HEIGHTS_M = (0.0, 0.3, 1.0, 10.0)
ROBOT_BAND = 0
"""The band of heights in which the robot moves."""


@functools.cache
def _outlines(asset: Asset) -> tuple[Floats | None, ...]:
    """Convex outline (N, 2) of an asset, counter-clockwise, in each band of heights; None where nothing is.

    What lies between vertices of different bands counts for both: edges are cut where they enter a band.
    """
    bands: list[Floats | None] = []
    for low, high in pairwise(_HEIGHTS_M):
        points = np.concatenate([_points_between(part.vertices, part.faces, low, high) for part in asset.parts])
        if len(points) < 3:
            bands.append(None)
            continue
        bands.append(points[ConvexHull(points).vertices])
    return tuple(bands)


def _points_between(vertices: Floats, faces: NDArray[np.int_], low_m: float, high_m: float) -> Floats:
    """Points (N, 2) of a mesh between two heights: its vertices there, and its edges' crossings of either height."""
    inside = (vertices[:, 2] >= low_m) & (vertices[:, 2] < high_m)
    points = [vertices[inside, :2]]
    starts, ends = vertices[faces].reshape(-1, 3), vertices[np.roll(faces, -1, axis=1)].reshape(-1, 3)
    for height in (low_m, high_m):
        crosses = (starts[:, 2] - height) * (ends[:, 2] - height) < 0
        a, b = starts[crosses], ends[crosses]
        share = (height - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
        points.append((a + share * (b - a))[:, :2])
    return np.concatenate(points)


def outline(placed: PlacedObject, band: int) -> Floats | None:
    """Convex outline (N, 2) of a placed object in the world at the start, in one band of heights."""
    local = _outlines(placed.asset)[band]
    return None if local is None else transform_points(placed.pose_at(0.0), local)


def overlap(first: PlacedObject, second: PlacedObject) -> bool:
    """Whether two objects stand inside each other, judged by their convex outlines band by band."""
    for band in range(len(_HEIGHTS_M) - 1):
        a, b = outline(first, band), outline(second, band)
        if a is not None and b is not None and not (_separated(a, b) or _separated(b, a)):
            return True
    return False


def clearance(start_xy: Floats, end_xy: Floats, placed: PlacedObject) -> float:
    """Distance in m between a straight way and what of an object the robot could hit; 0 where it leads through."""
    polygon = outline(placed, ROBOT_BAND)
    if polygon is None:
        return np.inf
    way = np.array([start_xy, end_xy])
    if _inside(polygon, way[0]) or _crosses(way, polygon):
        return 0.0
    sides = np.roll(polygon, -1, axis=0)
    to_corners = _distances(way[0], way[1], polygon)
    from_ends = [_distances(a, b, way).min() for a, b in zip(polygon, sides, strict=True)]
    return float(min(to_corners.min(), *from_ends))


def _separated(polygon: Floats, other: Floats) -> bool:
    """Whether a side of a counter-clockwise polygon has all of the other one on its outer side."""
    along = np.roll(polygon, -1, axis=0) - polygon
    outwards = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return bool(((other @ outwards.T - (polygon * outwards).sum(axis=1)).min(axis=0) > 0).any())


def _inside(polygon: Floats, point: Floats) -> bool:
    return not _separated(polygon, point[None])


def _crosses(way: Floats, polygon: Floats) -> bool:
    """Whether a segment (2, 2) crosses a side of a polygon."""
    start, along = way[0], way[1] - way[0]
    sides = np.roll(polygon, -1, axis=0) - polygon
    offset = polygon - start
    turn = along[0] * sides[:, 1] - along[1] * sides[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_way = (offset[:, 0] * sides[:, 1] - offset[:, 1] * sides[:, 0]) / turn
        on_side = (offset[:, 0] * along[1] - offset[:, 1] * along[0]) / turn
    return bool(((on_way >= 0) & (on_way <= 1) & (on_side >= 0) & (on_side <= 1)).any())


def _distances(start: Floats, end: Floats, points: Floats) -> Floats:
    """Distances (N,) of points (N, 2) to a segment, which may be a single point."""
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    away = points - start - share[:, None] * along
    distances: Floats = np.hypot(away[:, 0], away[:, 1])
    return distances
