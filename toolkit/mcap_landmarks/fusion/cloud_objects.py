"""Objects of a camera and a cloud: which points each box is of, where the object is, and how it lies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import ANY_SIZE, CLASSES, Cuboid
from mcap_landmarks.fusion.box_geometry import BoxGeometry
from mcap_landmarks.fusion.camera_range import by_foot, by_height, floor_along, height_span, together
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.frustum import CloudView, Piece, Upright, core, loose, pieces
from mcap_landmarks.fusion.seen_things import Seen
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.lidar.rectangles import BoxEdges, Rectangle, completed

FEWEST = 4
"""Fewer points than these may be of anything."""
_CROWN_M = 0.3
"""So much taller than the largest of its class an object may be: loads, antennas, uneven ground."""
MARGIN_M = 0.35
"""Points so near to an object's rectangle are of it, whatever cluster they are in: wheels, mirrors, loads."""
_ROOM_M = 0.5
"""How much larger than its class says something round may be."""
_MORE = 0.05
"""So many more points, as a share, are worth another fit."""
_USUAL_FIT, _LEAST_RATIO, _MOST_RATIO = 0.015, 0.2, 10.0
"""A piece of this weight says nothing for or against its box, and the most that one may say: a sure box on many points
never ends as nothing."""
_ROUND_M = 0.1
"""How well the middle of something round is known: people swing their arms."""
_DEPTH = 0.6
"""The middle of a round thing lies this share of its radius behind the mean of what is seen of it: between a disc's,
pi / 4 of it before its middle, and that of something that a LiDAR sees through."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """An image and the cloud beside it."""

    view: CameraView
    cloud: CloudView
    boxes: BoxGeometry
    config: FuseConfig

    def upright(self, found: "FoundObject", name: str) -> tuple[float, float]:
        """Where an object's foot is in the base frame, and how tall it is: what its class is, if it has no points."""
        floor, slope = floor_along(self.cloud, float(self.boxes.middle[found.box]))
        tall, _ = height_span(self.config.size(name), _cuboid(name))
        if not len(found.points):
            return floor + slope * float(np.hypot(*self.view.from_camera(found.place.centre_xy[None])[0])), tall
        return float(np.median(self.cloud.floors_m[found.points])), float(self.cloud.heights_m[found.points].max())


@dataclass(frozen=True, slots=True, eq=False)
class FoundObject:
    """The object of a box: the box's number, the probability that it is there, and where: its rectangle in the base
    frame, a square around something round; and the points (K,) of it in the cloud, none if only the camera places it.
    """

    box: int
    score: float
    place: Rectangle
    points: NDArray[np.intp]


def find(look: Look, things: Sequence[Seen]) -> list[FoundObject]:
    """The objects of boxes, in their order; none for what neither points nor the camera place.

    The box whose points fit best takes them first, the others choose among what is left: one object is of one box. The
    fit weighs, and never excludes.
    """
    found = _by_points(look, things)
    for i, thing in enumerate(things):
        if i not in found and np.count_nonzero(look.cloud.within(core(thing.box_xyxy))) < FEWEST:
            place = place_by_camera(look, i, thing.name)
            if place is not None:
                found[i] = FoundObject(i, thing.score, place, np.zeros(0, dtype=np.intp))
    return [found[i] for i in sorted(found)]


def _by_points(look: Look, things: Sequence[Seen]) -> dict[int, FoundObject]:
    """The objects of boxes that have points, by the boxes' numbers."""
    is_free = np.ones(len(look.cloud.points_xy), dtype=np.bool_)
    options = {i: piece for i, thing in enumerate(things) if (piece := _best(look, i, thing, is_free))}
    found: dict[int, FoundObject] = {}
    while options:
        i = max(options, key=lambda one: options[one].weight)
        found[i], taken = _of_piece(look, i, things[i], options.pop(i), is_free)
        is_free[taken] = False
        again = {
            other: piece if is_free[piece.points].all() else _best(look, other, things[other], is_free)
            for other, piece in options.items()
        }
        options = {other: piece for other, piece in again.items() if piece is not None}
    return found


def place_of(look: Look, box: int, name: str, points: NDArray[np.intp]) -> Rectangle:
    """Where the points (K,) of a box are, if they are of a class: a box with yaw, or something round."""
    cloud, camera = look.cloud, transform_points(look.view.scan_from_image, look.view.base_from_camera[:2, 3])
    cuboid = _cuboid(name)
    if cuboid is not None:
        return completed(cloud.points_xy[points], camera, cuboid, _edges(look, box, camera))
    middle = cloud.points_xy[points].mean(axis=0)
    ahead = (middle - camera) / max(float(np.hypot(*(middle - camera))), 1e-6)
    radius = _radius(look, box, name, float(np.median(cloud.ranges_m[points])))
    spread = _ROUND_M**2 * np.eye(2) + (radius / 2) ** 2 * np.outer(ahead, ahead)
    return Rectangle(middle + _DEPTH * radius * ahead, 2 * radius, 2 * radius, 0.0, spread)


def place_by_camera(look: Look, box: int, name: str) -> Rectangle | None:
    """Where the camera alone sees something: as far away as its height and its foot say; None if they hardly do."""
    size, boxes, view = look.config.known_size(name), look.boxes, look.view
    if size is None:
        return None
    camera, bearing = view.base_from_camera[:3, 3], float(boxes.middle[box])
    floor = floor_along(look.cloud, bearing)
    found = together(
        by_height(boxes, box, height_span(size, _cuboid(name))), by_foot(boxes, box, float(camera[2]), floor)
    )
    if not found.sigma_m <= look.config.camera_sigma_m:
        return None
    ahead = np.array([np.cos(bearing), np.sin(bearing)])
    across = np.array([-ahead[1], ahead[0]])
    along = np.hypot(found.sigma_m, size.radius_m / 2)
    aside = np.hypot(found.distance_m * float(boxes.sigma_rad[box]), size.radius_m / 3)
    axes = _turn(float(view.scan_from_image[2])) @ np.stack([along * ahead, aside * across], axis=1)
    centre = camera[:2] + (found.distance_m + _DEPTH * size.radius_m) * ahead
    radius = size.radius_m
    return Rectangle(transform_points(view.scan_from_image, centre), 2 * radius, 2 * radius, 0.0, axes @ axes.T)


def _best(look: Look, box: int, thing: Seen, is_free: NDArray[np.bool_]) -> Piece | None:
    """The likeliest piece of a box that has enough points."""
    name, boxes = thing.name, look.boxes
    size, known = look.config.size(name), look.config.known_size(name)
    upright = Upright(
        by_height(boxes, box, height_span(known, _cuboid(name))).distance_m if known else np.nan,
        _tallest(look, name),
        float(look.view.base_from_camera[2, 3]),
        np.nan if boxes.cut[box, 3] else float(boxes.bottom[box]),
        float(boxes.sigma_slope[box]),
        size.foot_m,
    )
    found = pieces(look.cloud, thing, is_free, upright)
    return next((piece for piece in found if len(piece.points) >= FEWEST), None)


def _of_piece(
    look: Look, box: int, thing: Seen, piece: Piece, is_free: NDArray[np.bool_]
) -> tuple[FoundObject, NDArray[np.intp]]:
    """The object that a piece is of, and all points that nothing else can be of."""
    cloud, name = look.cloud, thing.name
    low = is_free & (cloud.heights_m < _tallest(look, name))
    inside = cloud.within(loose(thing.box_xyxy))
    away = float(np.median(cloud.ranges_m[piece.points]))
    near = np.abs(cloud.ranges_m - away) < _reach(look, box, name, away)
    inside |= _beside(look, box)
    points = np.flatnonzero(low & inside & near & (cloud.clusters == cloud.clusters[piece.points[0]]))
    points = np.union1d(points, piece.points)
    place = place_of(look, box, name, points)
    if _cuboid(name) is None:
        return FoundObject(box, _probability(look, thing, piece.weight), place, points), points
    others = np.flatnonzero(low & inside)
    whole = np.union1d(points, others[place.holds(cloud.points_xy[others], MARGIN_M)])
    if len(whole) > (1 + _MORE) * len(points):
        points, place = whole, place_of(look, box, name, whole)
    around = np.flatnonzero(is_free & near)
    taken = around[place.holds(cloud.points_xy[around], MARGIN_M / 2)]
    return FoundObject(box, _probability(look, thing, piece.weight), place, points), np.union1d(points, taken)


def _beside(look: Look, box: int) -> NDArray[np.bool_]:
    """Which points (N,) of the cloud are beside the image, where the image cuts a box: the object goes on there."""
    left, right = look.boxes.cut[box, [0, 2]].tolist()
    if not (left or right):
        return np.zeros(len(look.cloud.bearings_rad), dtype=np.bool_)
    off = wrap(look.cloud.bearings_rad - look.boxes.middle[box])
    beyond: NDArray[np.bool_] = ((off > 0) & left) | ((off < 0) & right)
    return beyond & ~look.cloud.is_inside


def _probability(look: Look, thing: Seen, weight: float) -> float:
    """How probable it is that a box is of the piece that fits it best, which says little of what has no known size."""
    most = _MOST_RATIO if look.config.known_size(thing.name) else 1.0
    score, odds = thing.score, thing.score * float(np.clip(weight / _USUAL_FIT, _LEAST_RATIO, most))
    return odds / (odds + 1 - score) if score < 1 else 1.0


def _edges(look: Look, box: int, camera_xy: Array) -> BoxEdges:
    """A box's edges at the scan's time."""
    boxes, turned = look.boxes, float(look.view.scan_from_image[2])
    return BoxEdges(
        camera_xy,
        float(boxes.left[box]) + turned,
        float(boxes.right[box]) + turned,
        float(boxes.sigma_rad[box]),
        (float(boxes.slack_rad[box, 0]), float(boxes.slack_rad[box, 1])),
    )


def _cuboid(name: str) -> Cuboid | None:
    known = CLASSES.get(name)
    return known.cuboid if known else None


def _tallest(look: Look, name: str) -> float:
    return look.config.size(name).top_m[1] + _CROWN_M


def _radius(look: Look, box: int, name: str, away_m: float) -> float:
    """The radius of something round: its class's, or what fills the width of its box."""
    size = look.config.known_size(name)
    return size.radius_m if size else min(away_m * float(np.tan(look.boxes.half[box])), ANY_SIZE.width_m[1] / 2)


def _reach(look: Look, box: int, name: str, away_m: float) -> float:
    """How far before or behind the middle of its points other points of an object may be."""
    cuboid = _cuboid(name)
    if cuboid is None:
        return 2 * _radius(look, box, name, away_m) + _ROOM_M
    return float(np.hypot(cuboid.length_m[0] + 2 * cuboid.length_m[1], cuboid.width_m[0]))


def _turn(yaw_rad: float) -> Array:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s], [s, c]])
