"""Which of two tracks boxes were of: what each was seen in, and whether another one explains all of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import OFF_MIDDLE, BoxGeometry
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, compose, transform_points

_BOXES, _PLACES = 40, 600
"""How many are kept: boxes count only from another place each, places are a minute's at ten scans a second."""
_BEARING_RAD, _OFF_CENTRE = 0.01, 0.15
"""Standard deviations of a direction in the odometry frame, which drifts between two looks, and of where a track is, as
a share of its class's radius: shapes of a class differ."""
_ASIDE, _TALLER = 2.65, 1.25
"""How many sigmas off a box's middle a track can be, the root of the default of `bearing_gate`; and how many times
taller or smaller than its class has it."""
_ROUNDED_M = 1e-6
"""More than rounding moves a place."""
_FEW = 0.15
"""A share of boxes so small need not be explained: some have a wrong class, or are of something else again. The
poor detector of `tests.benchmark.perception` misnames 5 % of its boxes, and sees one thing too many in every image."""
_LEAST_M = 0.1
"""No track is nearer to the camera, which divides by that."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxObservation:
    """A box in an image, in the odometry frame: where the camera was, in which direction its middle, and how wide it
    may be off, in rad; its height over the distance, 0 if the image cuts it; the frame of the camera.

    All places where what is in it can be, by its size, are within `reach_m` of `centre_xy` (2,).
    """

    bundle: int
    name: str
    camera_xy: Array
    bearing_rad: float
    sigma_rad: float
    tall: float
    centre_xy: Array
    reach_m: float
    frame_id: str = ""


def observe(
    bundle: int, name: str, box: int, boxes: BoxGeometry, view: CameraView, odom_from_base: Array, size: Size
) -> BoxObservation:
    """One of the boxes in an image, of a class with a size, as a track's observation."""
    at_image = compose(odom_from_base, view.scan_from_image)
    half = float(boxes.half[box])
    is_cut = bool(boxes.cut[box, [0, 2]].any())
    camera_xy = transform_points(at_image, view.base_from_camera[:2, 3])
    bearing_rad = float(at_image[2] + boxes.middle[box])
    sigma_rad = half if is_cut else float(np.hypot(_BEARING_RAD, OFF_MIDDLE * half))
    tall = 0.0 if boxes.cut[box, [1, 3]].any() else float(boxes.top[box] - boxes.bottom[box])
    ahead_m, reach_m = _reach(sigma_rad, tall, size)
    centre_xy = camera_xy + ahead_m * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    return BoxObservation(bundle, name, camera_xy, bearing_rad, sigma_rad, tall, centre_xy, reach_m)


def _reach(sigma_rad: float, tall: float, size: Size) -> tuple[float, float]:
    """How far ahead the middle of a circle is, and its radius, that has all that `TrackHistory.could_be` lets be."""
    if not tall:
        return 0.0, np.inf
    near, far = (height_m / abs(tall) for height_m in _tall_span(size))
    widest = _ASIDE * np.hypot(sigma_rad, _OFF_CENTRE * size.radius_m / max(near, _LEAST_M))
    middle, ends = (near + far) / 2, np.array([near, far])
    chords = np.sqrt(ends**2 + middle**2 - 2 * middle * ends * np.cos(min(widest, np.pi)))
    return middle, float(chords.max()) + _ROUNDED_M


@dataclass(slots=True)
class TrackHistory:
    """The boxes of one track, and where it was in the odometry frame, by bundle."""

    boxes: list[BoxObservation] = field(default_factory=list)
    places: dict[int, Array] = field(default_factory=dict)

    def note(self, box: BoxObservation) -> None:
        """Another box; of very many the earliest are forgotten."""
        self.boxes = [*self.boxes[1 - _BOXES :], box]

    def stood(self, bundle: int, place_xy: Array) -> None:
        """Where it is now; of a long time the earliest places are forgotten."""
        self.places[bundle] = place_xy
        if len(self.places) > _PLACES:
            del self.places[next(iter(self.places))]

    def of(self, name: str) -> list[BoxObservation]:
        """The boxes of a class."""
        return [box for box in self.boxes if box.name == name]

    def could_be(self, boxes: Sequence[BoxObservation], size: Size, until: int) -> NDArray[np.bool_]:
        """Whether the track can have been in boxes (N,) of something of such a size.

        It cannot where it was elsewhere, or had a box of its own in that image. Where it was at an image that it was
        not seen beside is where it was last, of the bundles until a given one.
        """
        latest = next((place for bundle, place in reversed(self.places.items()) if bundle <= until), None)
        if latest is None or not boxes:
            return np.zeros(len(boxes), dtype=np.bool_)
        own = {(box.bundle, box.frame_id) for box in self.boxes}
        is_free = np.array([(box.bundle, box.frame_id) not in own for box in boxes])
        x, y = np.array([self.places.get(box.bundle, latest) - box.camera_xy for box in boxes]).T
        bearing, sigma, tall = np.array([(box.bearing_rad, box.sigma_rad, box.tall) for box in boxes]).T
        distance = np.hypot(x, y)
        sigma = np.hypot(sigma, _OFF_CENTRE * size.radius_m / np.maximum(distance, _LEAST_M))
        is_there = np.abs(wrap(np.arctan2(y, x) - bearing)) <= _ASIDE * sigma
        least, most = _tall_span(size)
        is_as_tall = (tall == 0) | ((least <= tall * distance) & (tall * distance <= most))
        return np.asarray(is_free & is_there & is_as_tall)


def is_redundant(own: TrackHistory, other: TrackHistory, name: str, size: Size, until: int) -> bool:
    """Whether the other track explains the boxes of a class that this one was in until some bundle, and more."""
    mine, others = own.of(name), other.of(name)
    left = int(np.count_nonzero(~other.could_be(mine, size, until)))
    return left <= _FEW * len(mine) and bool(np.count_nonzero(~own.could_be(others, size, until)) > max(left, 1))


def where_redundant(own: TrackHistory, name: str) -> list[tuple[Array, float]]:
    """Circles, as centres (2,) and radii in m; whoever makes a track of a class redundant has been in one of them.

    It explains all but a few of the boxes, so that of a few and one more it explains one: of those that reach the least
    far. Where there are no boxes, that is anyone.
    """
    boxes = sorted(own.of(name), key=lambda box: box.reach_m)
    few = boxes[: int(_FEW * len(boxes)) + 1]
    return [(box.centre_xy, box.reach_m) for box in few] or [(np.zeros(2), np.inf)]


def _tall_span(size: Size) -> tuple[float, float]:
    """From and to how many metres tall a box of something of a size may be."""
    most = min(size.tall_m[1], size.top_m[1] - size.foot_m[0])
    return size.least_tall_m / _TALLER, most * _TALLER
