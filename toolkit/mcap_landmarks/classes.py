"""What the toolkit knows of each class: how large it is, what a LiDAR meets of it, how fast it moves; one table."""

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
class Cuboid:
    """Length, width and height of whole objects in m, for each the mean and its standard deviation."""

    length_m: Span
    width_m: Span
    height_m: Span


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """One class: its size, the cross-sections that it may have at the LiDAR's height, and how fast it may be.

    A class without `sections` has no shape that a scan could be held against. One with a `cuboid` is a box in a cloud,
    which shows all of an object that is above the ground; others are round there. `speed_mps` is the usual speed of
    what moves by itself, 0 for what does not.
    """

    size: Size
    sections: tuple[Section, ...] = ()
    speed_mps: float = 0.0
    cuboid: Cuboid | None = None


_BICYCLE = tuple((x * 0.52 + y * 0.24, 0.0, 0.06, 0.044) for x in (1, -1) for y in (1, -1))
_BENCH = ((0.0, 0.58, 0.38, 0.07), (0.0, -0.58, 0.38, 0.07))
_BACKPACK = ((-0.045, 0.0, 0.19, 0.33), (0.055, 0.0, 0.10, 0.29), (0.11, 0.0, 0.06, 0.24), (-0.04, 0.0, 0.11, 0.40))
_CHAIR = tuple((x * 0.19, y * 0.19, 0.022) for x in (1, -1) for y in (1, -1))

CLASSES: dict[str, ObjectClass] = {
    "person": ObjectClass(
        Size(top_m=(1.5, 1.95), width_m=(0.3, 0.9), radius_m=0.25),
        (Legs(0.06, (0.16, 0.32)), Disc(0.25)),
        speed_mps=1.5,
    ),
    "bicycle": ObjectClass(
        Size(top_m=(0.9, 1.15), width_m=(0.4, 1.9), radius_m=0.81),
        (Parts(boxes=_BICYCLE, symmetry=2),),
        speed_mps=4.0,
        cuboid=Cuboid((1.72, 0.15), (0.60, 0.12), (1.10, 0.15)),
    ),
    "car": ObjectClass(
        Size(top_m=(1.35, 1.8), width_m=(1.5, 5.0), radius_m=2.27),
        (Box(4.2, 1.74, 0.3),),
        speed_mps=10.0,
        cuboid=Cuboid((4.2, 0.5), (1.74, 0.13), (1.56, 0.15)),
    ),
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
    "van": ObjectClass(
        Size(top_m=(1.8, 2.8), width_m=(1.7, 6.0), radius_m=2.7),
        speed_mps=10.0,
        cuboid=Cuboid((5.1, 0.5), (1.93, 0.13), (2.2, 0.3)),
    ),
    "truck": ObjectClass(
        Size(top_m=(1.9, 4.2), width_m=(1.8, 13.0), radius_m=4.3),
        speed_mps=10.0,
        cuboid=Cuboid((8.0, 2.5), (2.5, 0.25), (3.0, 0.5)),
    ),
    "bus": ObjectClass(
        Size(top_m=(2.6, 4.4), width_m=(2.2, 18.5), radius_m=5.8),
        speed_mps=10.0,
        cuboid=Cuboid((11.2, 2.0), (2.75, 0.25), (3.4, 0.4)),
    ),
    "motorcycle": ObjectClass(
        Size(top_m=(1.0, 1.9), width_m=(0.5, 2.4), radius_m=1.05),
        speed_mps=10.0,
        cuboid=Cuboid((2.1, 0.2), (0.77, 0.15), (1.45, 0.2)),
    ),
    "cyclist": ObjectClass(
        Size(top_m=(1.4, 1.95), width_m=(0.4, 1.95), radius_m=0.88),
        speed_mps=4.0,
        cuboid=Cuboid((1.76, 0.18), (0.60, 0.15), (1.74, 0.12)),
    ),
}
"""The bundled detector's classes and those that ride and drive: real objects in their usual range of size, and sections
0.12 to 0.19 m above ground, the height of a small robot's LiDAR; a person stands on legs or in a long coat. Cuboids are
between the means of the labels of KITTI (Geiger et al. 2012: car 3.88 x 1.63 x 1.53, van 5.08 x 1.90 x 2.21, truck
10.1 x 2.6 x 3.25, cyclist 1.76 x 0.60 x 1.74 m) and nuScenes (Caesar et al. 2020: car 4.61 x 1.95 x 1.72, truck 6.9 x
2.5 x 2.8, bus 11.2 x 2.9 x 3.5, motorcycle 2.1 x 0.77 x 1.47, bicycle 1.7 x 0.6 x 1.3 m), their deviations cover both.
A cyclist is a person with the bicycle that it rides."""

_OTHER_SPEEDS_MPS = {
    **dict.fromkeys(("train", "boat", "airplane"), 10.0),
    **dict.fromkeys(("bird", "cat", "dog", "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe"), 1.5),
}
"""Those of COCO that move by themselves, of unknown size; people and animals walk, vehicles drive in towns."""
_CARRIED = frozenset(
    {"backpack", "umbrella", "handbag", "suitcase", "skateboard", "surfboard", "skis", "snowboard", "frisbee"}
    | {"sports ball", "bottle", "cup", "bowl", "laptop", "book", "teddy bear", "chair", "potted plant"}
)
"""Those of COCO that people put elsewhere."""

ANY_SIZE = Size(top_m=(0.1, 6.0), width_m=(0.05, 6.0), radius_m=0.0)
"""What stands on the ground and is nothing of the above."""


def speed_mps(name: str) -> float:
    """The usual speed of what is of a class and moves by itself; 0 if it does not, or if the class is unknown."""
    return CLASSES[name].speed_mps if name in CLASSES else _OTHER_SPEEDS_MPS.get(name, 0.0)


def is_movable(name: str) -> bool:
    """Whether what is of a class may stand elsewhere another day: it moves by itself, or people carry it."""
    return speed_mps(name) > 0 or name in _CARRIED
