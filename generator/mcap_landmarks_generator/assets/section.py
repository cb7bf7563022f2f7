"""Horizontal cross-sections of objects at LiDAR height, declared per class and variant: unions of discs and boxes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A section holds for every LiDAR mounted between these heights above ground; Turtlebot3's sits at 0.132 m (Waffle Pi)
# or 0.182 m (Burger).
BAND_M = (0.12, 0.19)


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc of `radius_m` about (x_m, y_m) in the object's frame."""

    radius_m: float
    x_m: float = 0.0
    y_m: float = 0.0

    def signed_distance_m(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (N,) of points (N,2) to the outline, negative inside."""
        return np.hypot(points_xy[:, 0] - self.x_m, points_xy[:, 1] - self.y_m) - self.radius_m

    @property
    def reach_m(self) -> float:
        """Distance from the object's origin to the farthest point of the disc."""
        return float(np.hypot(self.x_m, self.y_m)) + self.radius_m


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle of `length_m` along x and `width_m` along y about (x_m, y_m), its corners rounded by `corner_m`."""

    length_m: float
    width_m: float
    x_m: float = 0.0
    y_m: float = 0.0
    corner_m: float = 0.0

    def signed_distance_m(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (N,) of points (N,2) to the outline, negative inside."""
        half = np.array([self.length_m / 2, self.width_m / 2]) - self.corner_m
        beyond = np.abs(points_xy - np.array([self.x_m, self.y_m])) - half
        outside = np.hypot(np.maximum(beyond[:, 0], 0.0), np.maximum(beyond[:, 1], 0.0))
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - self.corner_m)

    @property
    def reach_m(self) -> float:
        """Distance from the object's origin to the farthest corner, its rounding ignored."""
        return float(np.hypot(abs(self.x_m) + self.length_m / 2, abs(self.y_m) + self.width_m / 2))


@dataclass(frozen=True, slots=True)
class Section:
    """The union of `shapes`; its centre is the object's origin, which maps and truth call the object's position."""

    shapes: tuple[Disc | Box, ...]

    def signed_distance_m(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (N,) of points (N,2) to the outline, negative inside (a bound, not exact, deep inside overlaps)."""
        return np.asarray(np.min([shape.signed_distance_m(points_xy) for shape in self.shapes], axis=0))

    @property
    def radius_m(self) -> float:
        """Radius of the circle about the origin that encloses the section."""
        return max(shape.reach_m for shape in self.shapes)


def disc(radius_m: float) -> Section:
    """A single disc about the origin."""
    return Section((Disc(radius_m),))


def box(length_m: float, width_m: float, corner_m: float = 0.0) -> Section:
    """A single box about the origin."""
    return Section((Box(length_m, width_m, corner_m=corner_m),))


def legs(radius_m: float, separation_m: float) -> Section:
    """Two discs side by side along y, their centres `separation_m` apart."""
    return Section((Disc(radius_m, y_m=separation_m / 2), Disc(radius_m, y_m=-separation_m / 2)))


def four_legs(radius_m: float, length_m: float, width_m: float) -> Section:
    """Four discs whose centres are the corners of a rectangle about the origin."""
    return Section(tuple(Disc(radius_m, x * length_m / 2, y * width_m / 2) for x in (1, -1) for y in (1, -1)))
