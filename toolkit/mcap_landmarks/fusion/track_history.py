"""Which of two objects boxes were of: what a track was shown in, and whether another one explains all of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import Sights, View
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, compose, transform_points

_KEPT, _PLACES = 40, 600
_BEARING_RAD, _OFF_MIDDLE = 0.01, 0.2
_ASIDE, _TALLER = 2.65, 1.25
_FEW = 0.15
"""A share of boxes so small need not be explained: some have a wrong class, or are of something else again."""


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A box in an image, in the odometry frame: where the camera was, in which direction its middle, and how wide it
    may be off, in rad; its height over the distance, 0 if the image cuts it.
    """

    bundle: int
    name: str
    camera_xy: Array
    bearing_rad: float
    sigma_rad: float
    tall: float


def shown(bundle: int, name: str, box: int, sights: Sights, view: View, odom_from_base: Array) -> Shown:
    """What one of the boxes in an image shows of a class."""
    at_image = compose(odom_from_base, view.scan_from_image)
    half = abs(float(wrap(sights.left[box] - sights.right[box]))) / 2
    is_cut = bool(sights.cut[box, [0, 2]].any())
    return Shown(
        bundle,
        name,
        transform_points(at_image, view.base_from_camera[:2, 3]),
        float(at_image[2] + sights.middle[box]),
        half if is_cut else float(np.hypot(_BEARING_RAD, _OFF_MIDDLE * half)),
        0.0 if sights.cut[box, [1, 3]].any() else float(sights.top[box] - sights.bottom[box]),
    )


@dataclass(slots=True)
class Past:
    """The boxes of one track, and where it was in the odometry frame (bundle, place)."""

    shown: list[Shown] = field(default_factory=list)
    places: dict[int, Array] = field(default_factory=dict)

    def note(self, box: Shown) -> None:
        """Another box; of very many the earliest are forgotten."""
        self.shown = [*self.shown[1 - _KEPT :], box]

    def stood(self, bundle: int, place_xy: Array) -> None:
        """Where it is now; of a long time the earliest places are forgotten."""
        self.places[bundle] = place_xy
        if len(self.places) > _PLACES:
            del self.places[next(iter(self.places))]

    def unexplained(self, other: "Past", name: str, size: Size) -> int:
        """How many boxes of a class the other track cannot have been in, since it was elsewhere or had its own."""
        return sum(not other.could_be(box, size) for box in self.of(name))

    def of(self, name: str) -> Sequence[Shown]:
        """The boxes of a class."""
        return [box for box in self.shown if box.name == name]

    def could_be(self, box: Shown, size: Size) -> bool:
        """Whether the track can have been in a box of something of such a size."""
        if not self.places or any(own.bundle == box.bundle for own in self.shown):
            return False
        latest = next(reversed(self.places.values()))
        x, y = self.places.get(box.bundle, latest) - box.camera_xy
        distance = float(np.hypot(x, y))
        sigma = float(np.hypot(box.sigma_rad, _FEW * size.radius_m / max(distance, 0.1)))
        if abs(wrap(np.arctan2(y, x) - box.bearing_rad)) > _ASIDE * sigma:
            return False
        most = min(size.tall_m[1], size.top_m[1] - size.foot_m[0])
        return not box.tall or size.least_tall_m / _TALLER <= box.tall * distance <= most * _TALLER


def is_redundant(own: Past, other: Past, name: str, size: Size) -> bool:
    """Whether the other track explains the boxes of a class that this one was in, and more."""
    left = own.unexplained(other, name, size)
    return left <= _FEW * len(own.of(name)) and other.unexplained(own, name, size) > max(left, 1)
