"""Traffic cone: orange with white bands on a dark square foot."""

from itertools import pairwise

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, plain

# The cone's radius in the middle of the LiDAR's band, and how fast it shrinks with height.
MIDDLE_M, MIDDLE_HEIGHT_M, SLOPE = 0.14, 0.155, 0.11


def shape(rng: np.random.Generator) -> list[Solid]:
    """A cone of 0.7 to 1.0 m."""
    height = rng.uniform(0.7, 1.0)
    bands = [0.03, 0.28, 0.45, 0.55, 0.70, height]
    solids = [box(0.44, 0.44, 0.03, "foot").moved(z_m=0.015)]
    for index, (low, high) in enumerate(pairwise(bands)):
        profile = [(MIDDLE_M + SLOPE * (MIDDLE_HEIGHT_M - z), z) for z in (low, min(high, height))]
        if high > low:
            solids.append(lathe(profile, "white" if index % 2 else "orange", 20))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Orange or red."""
    return {
        "orange": plain(rng, hsv(rng.uniform(0.01, 0.07), 0.92, rng.uniform(0.8, 1))),
        "white": plain(rng, grey(rng, 0.85, 0.97)),
        "foot": plain(rng, grey(rng, 0.06, 0.2)),
    }


CLASS = AssetClass("cone", None, {"standard": Variant(section.disc(MIDDLE_M), shape, paint)})
