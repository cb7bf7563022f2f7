"""Cross-sections of objects at LiDAR height, and how far into them a ray gets before it meets them."""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array

OFFSETS = 321
"""How many rays there are in a profile side by side; the outermost two on either side pass the shape."""
_TURN_ERROR_M = 0.003
"""Between two headings of a profile the farthest point moves by no more than twice this: below the noise of a range."""
_SIZES = 17
"""Sizes of a profile, evenly spaced: legs 0.16 to 0.32 m apart come in steps of a centimetre, the noise of a range."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A union of `discs` (x, y, radius) and `boxes` (x, y, length along x, width) in m about the object's centre.

    `apart_m` makes it two discs like the only one in `discs`, whose centres are so far apart, from and to. The shape
    looks the same again after `turn_rad`; 0 for any turn.
    """

    discs: tuple[tuple[float, float, float], ...] = ()
    boxes: tuple[tuple[float, float, float, float], ...] = ()
    apart_m: tuple[float, float] | None = None
    turn_rad: float = 2 * np.pi

    @property
    def reach_m(self) -> float:
        """Distance from the centre to the farthest point."""
        if self.apart_m is not None:
            return self.apart_m[1] / 2 + self.discs[0][2]
        discs = [np.hypot(x, y) + radius for x, y, radius in self.discs]
        boxes = [np.hypot(abs(x) + length / 2, abs(y) + width / 2) for x, y, length, width in self.boxes]
        return float(max(discs + boxes))


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Where rays meet a shape: `depths_m` (sizes, headings, offsets), inf for a miss.

    A ray has a heading in the shape's frame, from 0 to where the shape looks the same again, and passes the centre,
    which lies so many `step_m` to its left as the offset is beyond the middle one. The depth counts from where the ray
    is abreast of the centre, negative before.
    """

    depths_m: NDArray[np.float32]
    step_m: float

    @property
    def least_width_m(self) -> float:
        """The width that every view shows without a hole; 0 where rays may pass between the parts."""
        seen = np.isfinite(self.depths_m)
        whole = (np.diff(seen, axis=-1).sum(axis=-1) == 2).all()
        return float(seen.sum(axis=-1).min()) * self.step_m if whole else 0.0


@cache
def profile(shape: Shape) -> Profile:
    """The shape as rays meet it."""
    step = shape.reach_m / (OFFSETS // 2 - 2)
    offsets: Array = step * np.arange(-(OFFSETS // 2), OFFSETS // 2 + 1, dtype=np.float64)
    turns = max(int(np.ceil(shape.turn_rad / 2 * shape.reach_m / _TURN_ERROR_M)), 1)
    headings = shape.turn_rad * np.arange(turns) / turns
    sizes = [None] if shape.apart_m is None else np.linspace(*shape.apart_m, _SIZES).tolist()
    depths = np.stack([_depths(shape, headings, offsets, size) for size in sizes])
    depths[..., [0, -1]] = np.inf
    return Profile(depths.astype(np.float32), float(step))


def disc(radius_m: float) -> Shape:
    """A disc."""
    return Shape(discs=((0.0, 0.0, radius_m),), turn_rad=0.0)


def legs(radius_m: float, apart_m: tuple[float, float]) -> Shape:
    """Two legs whose centres are so far apart, from and to; the object's centre lies between them."""
    return Shape(discs=((0.0, 0.0, radius_m),), apart_m=apart_m, turn_rad=np.pi)


def box(length_m: float, width_m: float, corner_m: float = 0.0) -> Shape:
    """A rectangle, its corners rounded."""
    if corner_m <= 0:
        return Shape(boxes=((0.0, 0.0, length_m, width_m),), turn_rad=np.pi)
    x, y = length_m / 2 - corner_m, width_m / 2 - corner_m
    corners = tuple((side_x * x, side_y * y, corner_m) for side_x, side_y in product((1, -1), repeat=2))
    boxes = ((0.0, 0.0, length_m, 2 * y), (0.0, 0.0, 2 * x, width_m))
    return Shape(corners, boxes, turn_rad=np.pi)


def _depths(shape: Shape, headings: Array, offsets: Array, apart_m: float | None) -> Array:
    """Depths (headings, offsets) of a shape of one size."""
    discs = shape.discs
    if apart_m is not None:
        discs = tuple((0.0, side * apart_m / 2, shape.discs[0][2]) for side in (1, -1))
    c, s = np.cos(headings)[:, None], np.sin(headings)[:, None]
    nearest = np.full((len(headings), len(offsets)), np.inf)
    for x, y, radius in discs:  # the disc's centre is so far ahead, and to the left of the ray
        ahead, left = c * x + s * y, c * y - s * x + offsets
        nearest = np.minimum(nearest, np.where(np.abs(left) <= radius, ahead - _half_chord(radius, left), np.inf))
    for x, y, length, width in shape.boxes:
        nearest = np.minimum(nearest, _into_box((s * offsets - x, -c * offsets - y), (c, s), (length / 2, width / 2)))
    return nearest


def _half_chord(radius_m: float, offset_m: Array) -> Array:
    return np.sqrt(np.maximum(radius_m**2 - offset_m**2, 0.0))


def _into_box(feet: tuple[Array, Array], ahead: tuple[Array, Array], half_m: tuple[float, float]) -> Array:
    """Depth at which rays through `feet` (x, y) along unit vectors (x, y) enter a box about the origin."""
    enter, leave = np.full(feet[0].shape, -np.inf), np.full(feet[0].shape, np.inf)
    for foot, along, half in zip(feet, ahead, half_m, strict=True):
        steep = np.where(np.abs(along) < 1e-9, 1e-9, along)
        one, other = (-half - foot) / steep, (half - foot) / steep
        enter, leave = np.maximum(enter, np.minimum(one, other)), np.minimum(leave, np.maximum(one, other))
    return np.where(enter <= leave, enter, np.inf)
