"""How scans are clustered, and the shapes of the classes."""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field

from mcap_landmarks.lidar import shapes
from mcap_landmarks.lidar.shapes import Shape

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(gt=0, lt=1)]


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("nothing is between these; give the lower number first")
    return span


Rising = Annotated[tuple[float, float], AfterValidator(_rising)]


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc."""

    radius_m: Positive
    kind: Literal["disc"] = "disc"

    def shape(self) -> Shape:
        """As the LiDAR's code knows it."""
        return shapes.disc(self.radius_m)


@dataclass(frozen=True, slots=True)
class Legs:
    """Two discs whose centres are `apart_m` from each other, from and to."""

    radius_m: Positive
    apart_m: tuple[Positive, Positive]
    kind: Literal["legs"] = "legs"

    def shape(self) -> Shape:
        """As the LiDAR's code knows it."""
        return shapes.legs(self.radius_m, (min(self.apart_m), max(self.apart_m)))


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle with rounded corners."""

    length_m: Positive
    width_m: Positive
    corner_m: Annotated[float, Field(ge=0)] = 0.0
    kind: Literal["box"] = "box"

    def shape(self) -> Shape:
        """As the LiDAR's code knows it."""
        corner = min(self.corner_m, self.length_m / 2, self.width_m / 2)
        return shapes.box(self.length_m, self.width_m, corner)


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

    def shape(self) -> Shape:
        """As the LiDAR's code knows it."""
        return Shape(self.discs, self.boxes, turn_rad=2 * math.pi / self.symmetry)


AnyShape = Annotated[Disc | Legs | Box | Parts, Discriminator("kind")]
Shapes = dict[str, tuple[AnyShape, ...]]

_BICYCLE = tuple((x * 0.52 + y * 0.24, 0.0, 0.06, 0.044) for x in (1, -1) for y in (1, -1))
_BENCH = ((0.0, 0.58, 0.38, 0.07), (0.0, -0.58, 0.38, 0.07))
_BACKPACK = ((-0.045, 0.0, 0.19, 0.33), (0.055, 0.0, 0.10, 0.29), (0.11, 0.0, 0.06, 0.24), (-0.04, 0.0, 0.11, 0.40))
_CHAIR = tuple((x * 0.19, y * 0.19, 0.022) for x in (1, -1) for y in (1, -1))

DEFAULT_SHAPES: Shapes = {
    "person": (Legs(0.06, (0.16, 0.32)), Disc(0.25)),
    "bicycle": (Parts(boxes=_BICYCLE, symmetry=2),),
    "car": (Box(4.2, 1.74, 0.3),),
    "traffic light": (Disc(0.15),),
    "fire hydrant": (Disc(0.15),),
    "stop sign": (Disc(0.04), Disc(0.20)),
    "bench": (Parts(boxes=_BENCH, symmetry=2),),
    "backpack": (Parts(boxes=_BACKPACK),),
    "suitcase": (Box(0.50, 0.28, 0.04),),
    "sports ball": (Disc(0.148),),
    "chair": (Parts(discs=_CHAIR, symmetry=4),),
    "potted plant": (Disc(0.18),),
}
"""Sections of the bundled detector's classes, 0.12 to 0.19 m above ground; a person on legs or in a long coat."""


def _over_defaults(given: Any) -> Any:  # noqa: ANN401 - whatever the file says
    return {**DEFAULT_SHAPES, **given} if isinstance(given, dict) else given


@dataclass(frozen=True, slots=True)
class ClusterConfig:
    """How scans become objects.

    `shapes`: the cross-sections of classes at the LiDAR's height, each a list of tables with a `kind` (disc, legs, box,
    parts); classes that are not named keep theirs, an empty list takes one out. `sigma_m`: noise of a range; `dropout`:
    share of beams that return nothing from an object; `stray`: share of hits that are something else's.
    `incidence_deg`: no surface is met at a smaller angle, so that neighbouring hits farther apart are of two; `link_m`:
    hits of one piece are no farther apart, and pieces no farther apart than `near_m` are one. What is larger than
    `largest_m` is background; unset, what is larger than every shape. `range_m` and `view_deg` limit what is looked at:
    distances from the LiDAR, bearings in the base frame, counter-clockwise from, to; unset, all that the scan gives.
    `gate_m`: how far an object may be from where it was last, through odometry, and keep its id, which is kept for
    `memory_s` without being seen. Of a point cloud the points between the heights `slice_m` in the base frame count,
    the nearest one in every `slice_beam_deg`, or as finely as the cloud goes if that is coarser.

    The thesis (Algorithm 2) has 0 to 30 and 330 to 360 degrees, 0.5 to 15 m, and the middle beam of every run of hits.
    """

    method: Literal["default", "thesis"] = "default"
    shapes: Annotated[Shapes, BeforeValidator(_over_defaults)] = field(default_factory=lambda: dict(DEFAULT_SHAPES))
    sigma_m: Positive = 0.01
    dropout: Share = 0.01
    stray: Share = 0.01
    incidence_deg: Annotated[float, Field(gt=0, lt=90)] = 10.0
    link_m: Positive = 0.3
    near_m: Positive = 0.13
    largest_m: Positive | None = None
    range_m: Rising | None = None
    view_deg: tuple[float, float] | None = None
    gate_m: Positive = 0.5
    memory_s: Positive = 10.0
    slice_m: Rising | None = None
    slice_beam_deg: Annotated[float, Field(gt=0, le=10)] = 0.5
