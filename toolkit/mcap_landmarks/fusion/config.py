"""How detections and scan objects are fused: the one configuration of what this package does."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mcap_landmarks.classes import ANY_SIZE, CLASSES, Positive, Size

Share = Annotated[float, Field(ge=0, le=1)]
Factor = Annotated[float, Field(gt=0, le=1)]


@dataclass(frozen=True, slots=True)
class FuseConfig:
    """How detections and scan objects become scene objects.

    Only detections of `landmark_classes` count (all, if empty), and those of `ignore_classes` never. An object is in
    the scene if its most probable class has `min_probability`; a scene of fewer than `min_objects` is left empty. Where
    a cloud has no points on it the camera alone places an object, if the range is sure to `camera_sigma_m`.
    `sizes` add to the built-in ones, by class: what heights and widths of a box are plausible, and the radius at the
    LiDAR's height; a class without gets its radius from the width of its boxes. A box and an object belong together if
    the chi-squares of their bearing and of its height and width are below `bearing_gate` and `size_gate`. Boxes are
    sure to `edge_px` and `edge_share` of their size, bearings to `bearing_sigma_deg`, and an object's parts that the
    LiDAR meets lie within `lateral_m` of its middle. `prior_odds`, `hit_odds`, `confusion`, `miss_odds`, `max_odds` say
    how evidence adds up along a track: its odds of being of a class at first (`prior_odds_alone` without odometry,
    where every scan is on its own), the most that one detection multiplies them by, the share of that for every other
    class, what an image without it leaves of them if it would be `min_height_px` high there, and the most that they
    get. `rectified` images have no distortion and the projection matrix of CameraInfo; unset, the name of their topic
    tells (`image_rect`, `image_rect_color`). The thesis (Algorithm 3) sorts
    boxes about `image_centre_px`.
    """

    method: Literal["default", "thesis"] = "default"
    landmark_classes: tuple[str, ...] = ()
    ignore_classes: tuple[str, ...] = ()
    min_probability: Share = 0.5
    min_objects: Annotated[int, Field(ge=1)] = 1
    sizes: dict[str, Size] = field(default_factory=dict)
    bearing_gate: Positive = 7.0
    size_gate: Positive = 4.0
    edge_px: Positive = 2.0
    edge_share: Share = 0.04
    bearing_sigma_deg: Positive = 0.3
    lateral_m: Positive = 0.05
    prior_odds: Positive = 0.03
    prior_odds_alone: Positive = 0.3
    hit_odds: Positive = 200.0
    confusion: Factor = 0.05
    miss_odds: Factor = 0.2
    max_odds: Positive = 1e3
    min_height_px: Positive = 20.0
    rectified: bool | None = None
    camera_sigma_m: Positive = 3.0
    image_centre_px: float = 320.5

    @property
    def bearing_sigma_rad(self) -> float:
        """What bearings are sure to."""
        return float(np.deg2rad(self.bearing_sigma_deg))

    def known_size(self, name: str) -> Size | None:
        """The size of a class, if there is one of its own."""
        if name in self.sizes:
            return self.sizes[name]
        return CLASSES[name].size if name in CLASSES else None

    def size(self, name: str) -> Size:
        """The size of a class; that of anything, if there is none of its own."""
        return self.known_size(name) or ANY_SIZE

    @property
    def largest_radius_m(self) -> float:
        """No object's radius is larger, whether it comes from its class or from the width of its boxes."""
        sizes = [*self.sizes.values(), *(known.size for known in CLASSES.values())]
        return max(ANY_SIZE.width_m[1] / 2, *(size.radius_m for size in sizes))
