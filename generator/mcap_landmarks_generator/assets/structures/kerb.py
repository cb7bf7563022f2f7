"""Kerb: four metres of edging stones, lower than the robot's planar LiDAR."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, plain, rectangle

LENGTH_M, WIDTH_M, HEIGHT_M = 4.0, 0.15, 0.10


def shape(rng: np.random.Generator) -> list[Solid]:
    """Four stones of a metre, a few millimetres uneven."""
    stones = []
    for place in (-1.5, -0.5, 0.5, 1.5):
        height = HEIGHT_M - rng.uniform(0.0, 0.006)
        stones.append(box(0.25 * LENGTH_M, WIDTH_M, height, "stone").moved(x_m=place, z_m=height / 2))
    return stones


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Concrete or granite with a joint at either end."""
    image = plain(rng, grey(rng, 0.45, 0.75), 64, mottle=0.2)
    for low in (0.0, 0.985):
        rectangle(image, (low, 0.0), (low + 0.015, 1.0), grey(rng, 0.2, 0.3))
    return {"stone": image}


CLASS = AssetClass("kerb", None, {"standard": Variant(section.box(LENGTH_M, WIDTH_M), shape, paint)})
