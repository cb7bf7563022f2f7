"""How scans are clustered: the one configuration of what this package does."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field

from mcap_landmarks.classes import CLASSES, Positive, Section

Share = Annotated[float, Field(gt=0, lt=1)]


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("nothing is between these; give the lower number first")
    return span


Rising = Annotated[tuple[float, float], AfterValidator(_rising)]
Sections = dict[str, tuple[Annotated[Section, Discriminator("kind")], ...]]


def _sections() -> Sections:
    return {name: known.sections for name, known in CLASSES.items() if known.sections}


def _over_known(given: object) -> object:
    return {**_sections(), **given} if isinstance(given, dict) else given


@dataclass(frozen=True, slots=True)
class ClusterConfig:
    """How scans become objects.

    `shapes`: the cross-sections of classes at the LiDAR's height, each a list of tables with a `kind` (disc, legs, box,
    parts); classes that are not named keep theirs, an empty list takes one out. `sigma_m`: noise of a range, and more
    where the scans scatter more about these shapes (`range_noise`); `dropout`: share of beams that return nothing from
    an object; `stray`: share of hits that are something else's.
    `incidence_deg`: no surface is met at a smaller angle, so that neighbouring hits farther apart are of two; `link_m`:
    hits of one piece are no farther apart, and pieces no farther apart than `near_m` are one. What is larger than
    `largest_m` is background; unset, what is larger than every shape. `range_m` and `view_deg` limit what is looked at:
    distances from the LiDAR, bearings in the base frame, counter-clockwise from, to; unset, all that the scan gives.
    `gate_m`: how far an object may be from where it was last, through odometry, and keep its id, which is kept for
    `memory_s` without being seen. Where nothing tells how the robot moved while a scan was measured, `speed_mps` and
    `turn_dps` are how fast it drives and turns, root mean squares (the demo's recordings have 0.5 m/s and 12 to 34
    degrees per second, two real Neatos 0.2 and 6 to 14): objects are as unsure as that makes them.

    A point cloud is taken as a whole: points more than `clearance_m` and less than `tallest_m` above the ground around
    them, in clusters of `fewest_points` or more. If `slice_m` is given, the points between those heights in the base
    frame count alone, as a planar scan: the nearest one in every `slice_beam_deg`, or as finely as the cloud goes if
    that is coarser.

    The thesis (Algorithm 2) has 0 to 30 and 330 to 360 degrees, 0.5 to 15 m, and the middle beam of every run of hits.
    """

    method: Literal["default", "thesis"] = "default"
    shapes: Annotated[Sections, BeforeValidator(_over_known)] = field(default_factory=_sections)
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
    speed_mps: Annotated[float, Field(ge=0)] = 0.5
    turn_dps: Annotated[float, Field(ge=0)] = 20.0
    clearance_m: Positive = 0.25
    tallest_m: Positive = 4.5
    fewest_points: Annotated[int, Field(ge=1)] = 4
    slice_m: Rising | None = None
    slice_beam_deg: Annotated[float, Field(gt=0, le=10)] = 0.5
