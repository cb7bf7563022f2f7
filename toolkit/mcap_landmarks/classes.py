"""What the toolkit knows of each class: how large it is, what a LiDAR meets of it, whether it moves; one table."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

Positive = Annotated[float, Field(gt=0)]
Span = tuple[float, float]

_DISTANCES, _BLURRED = math.log(10.0), 0.2
"""Logarithms of the ratio of the farthest and the nearest distance of what a camera shows, and of errors of height."""


@dataclass(frozen=True, slots=True)
class Size:
    """Least and largest measures of what a detector's box of a class holds, in m.

    `foot_m` and `top_m` are heights above ground of its lower and upper edge, `tall_m` is the distance between them,
    `width_m` its width seen from any side. `radius_m` is that of a circle around the object's cross-section at the
    LiDAR's height.
    """

    top_m: Span
    width_m: Span
    radius_m: float
    foot_m: Span = (0.0, 0.0)
    tall_m: Span = (0.0, 100.0)

    @property
    def least_tall_m(self) -> float:
        """The least height of a box."""
        return max(self.tall_m[0], self.top_m[0] - self.foot_m[1])

    @property
    def telling(self) -> float:
        """How much likelier a box's height is at the object's distance than at any that there could be."""
        most = min(self.tall_m[1], self.top_m[1] - self.foot_m[0])
        return max(1.0, _DISTANCES / (math.log(most / self.least_tall_m) + _BLURRED))


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc."""

    radius_m: Positive
    kind: Literal["disc"] = "disc"


@dataclass(frozen=True, slots=True)
class Legs:
    """Two discs whose centres are `apart_m` from each other, from and to."""

    radius_m: Positive
    apart_m: tuple[Positive, Positive]
    kind: Literal["legs"] = "legs"


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle with rounded corners."""

    length_m: Positive
    width_m: Positive
    corner_m: Annotated[float, Field(ge=0)] = 0.0
    kind: Literal["box"] = "box"


@dataclass(frozen=True, slots=True)
class Parts:
    """Several `discs` (x, y, radius) and `boxes` (x, y, length along x, width along y) about the centre."""

    discs: tuple[tuple[float, float, Positive], ...] = ()
    boxes: tuple[tuple[float, float, Positive, Positive], ...] = ()
    symmetry: Annotated[int, Field(ge=1, le=12)] = 1
    """So many turns in a full one look the same."""
    kind: Literal["parts"] = "parts"

    def __post_init__(self) -> None:
        if not (self.discs or self.boxes):
            raise ValueError("a shape of parts needs discs or boxes")


Section = Disc | Legs | Box | Parts


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """One class: its size, the cross-sections that it may have at the LiDAR's height, and whether it moves by itself.

    A class without `sections` has no shape that a scan could be held against.
    """

    size: Size
    sections: tuple[Section, ...] = ()
    moves: bool = False


_BICYCLE = tuple((x * 0.52 + y * 0.24, 0.0, 0.06, 0.044) for x in (1, -1) for y in (1, -1))
_BENCH = ((0.0, 0.58, 0.38, 0.07), (0.0, -0.58, 0.38, 0.07))
_BACKPACK = ((-0.045, 0.0, 0.19, 0.33), (0.055, 0.0, 0.10, 0.29), (0.11, 0.0, 0.06, 0.24), (-0.04, 0.0, 0.11, 0.40))
_CHAIR = tuple((x * 0.19, y * 0.19, 0.022) for x in (1, -1) for y in (1, -1))

CLASSES: dict[str, ObjectClass] = {
    "person": ObjectClass(
        Size(top_m=(1.5, 1.95), width_m=(0.3, 0.9), radius_m=0.25), (Legs(0.06, (0.16, 0.32)), Disc(0.25)), moves=True
    ),
    "bicycle": ObjectClass(
        Size(top_m=(0.9, 1.15), width_m=(0.4, 1.9), radius_m=0.81), (Parts(boxes=_BICYCLE, symmetry=2),), moves=True
    ),
    "car": ObjectClass(Size(top_m=(1.35, 1.8), width_m=(1.5, 5.0), radius_m=2.27), (Box(4.2, 1.74, 0.3),), moves=True),
    "traffic light": ObjectClass(
        Size(top_m=(2.0, 6.0), width_m=(0.25, 0.7), radius_m=0.15, foot_m=(1.0, 5.0), tall_m=(0.7, 1.2)), (Disc(0.15),)
    ),
    "fire hydrant": ObjectClass(Size(top_m=(0.6, 0.95), width_m=(0.3, 0.6), radius_m=0.15), (Disc(0.15),)),
    "stop sign": ObjectClass(
        Size(top_m=(1.8, 3.2), width_m=(0.05, 0.95), radius_m=0.2, foot_m=(1.0, 2.4), tall_m=(0.6, 0.95)),
        (Disc(0.04), Disc(0.20)),
    ),
    "bench": ObjectClass(Size(top_m=(0.7, 1.0), width_m=(0.5, 2.2), radius_m=0.64), (Parts(boxes=_BENCH, symmetry=2),)),
    "backpack": ObjectClass(Size(top_m=(0.42, 0.65), width_m=(0.28, 0.5), radius_m=0.22), (Parts(boxes=_BACKPACK),)),
    "suitcase": ObjectClass(Size(top_m=(0.5, 1.05), width_m=(0.25, 0.65), radius_m=0.29), (Box(0.50, 0.28, 0.04),)),
    "sports ball": ObjectClass(Size(top_m=(0.18, 0.32), width_m=(0.18, 0.32), radius_m=0.15), (Disc(0.148),)),
    "chair": ObjectClass(
        Size(top_m=(0.75, 1.1), width_m=(0.4, 0.8), radius_m=0.29), (Parts(discs=_CHAIR, symmetry=4),)
    ),
    "potted plant": ObjectClass(Size(top_m=(0.3, 1.4), width_m=(0.25, 1.3), radius_m=0.18), (Disc(0.18),)),
}
"""The bundled detector's classes: real objects in their usual range of size, and sections 0.12 to 0.19 m above ground,
the height of a small robot's LiDAR; a person stands on legs or in a long coat."""

ANY_SIZE = Size(top_m=(0.1, 6.0), width_m=(0.05, 6.0), radius_m=0.0)
"""What stands on the ground and is nothing of the above."""
