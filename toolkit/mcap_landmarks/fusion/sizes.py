"""How large objects are, as far as an image shows it: by class, for the classes that a street has."""

import math
from dataclasses import dataclass

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


SIZES: dict[str, Size] = {
    "person": Size(top_m=(1.5, 1.95), width_m=(0.3, 0.9), radius_m=0.25),
    "bicycle": Size(top_m=(0.9, 1.15), width_m=(0.4, 1.9), radius_m=0.81),
    "car": Size(top_m=(1.35, 1.8), width_m=(1.5, 5.0), radius_m=2.27),
    "traffic light": Size(top_m=(2.0, 6.0), width_m=(0.25, 0.7), radius_m=0.15, foot_m=(1.0, 5.0), tall_m=(0.7, 1.2)),
    "fire hydrant": Size(top_m=(0.6, 0.95), width_m=(0.3, 0.6), radius_m=0.15),
    "stop sign": Size(top_m=(1.8, 3.2), width_m=(0.05, 0.95), radius_m=0.2, foot_m=(1.0, 2.4), tall_m=(0.6, 0.95)),
    "bench": Size(top_m=(0.7, 1.0), width_m=(0.5, 2.2), radius_m=0.64),
    "backpack": Size(top_m=(0.42, 0.65), width_m=(0.28, 0.5), radius_m=0.22),
    "suitcase": Size(top_m=(0.5, 1.05), width_m=(0.25, 0.65), radius_m=0.29),
    "sports ball": Size(top_m=(0.18, 0.32), width_m=(0.18, 0.32), radius_m=0.15),
    "chair": Size(top_m=(0.75, 1.1), width_m=(0.4, 0.8), radius_m=0.29),
    "potted plant": Size(top_m=(0.3, 1.4), width_m=(0.25, 1.3), radius_m=0.18),
}
"""Real objects of these classes, their usual range."""

ANY_SIZE = Size(top_m=(0.1, 6.0), width_m=(0.05, 6.0), radius_m=0.0)
"""What stands on the ground and is nothing of the above."""
