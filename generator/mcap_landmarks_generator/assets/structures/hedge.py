"""Hedge: three metres of clipped leaves."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import rounded_rectangle, stack
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, hsv, noise, to_image

LENGTH_M, WIDTH_M, CORNER_M = 3.0, 0.6, 0.12


def shape(rng: np.random.Generator) -> list[Solid]:
    """A hedge of 0.7 to 1.2 m, its top a little uneven."""
    height = rng.uniform(0.7, 1.2)
    foot = rounded_rectangle(LENGTH_M, WIDTH_M, CORNER_M)
    top = rounded_rectangle(LENGTH_M - 0.16, WIDTH_M - 0.16, CORNER_M / 2)
    return [stack([(0.0, foot), (0.3, foot), (height - 0.08, foot * (1.0, 0.95)), (height, top)], "leaves")]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Leaves, lit and in shade."""
    green = hsv(rng.uniform(0.22, 0.36), rng.uniform(0.45, 0.75), rng.uniform(0.3, 0.55))
    leaves = noise(rng, 128, 256, octaves=3, cells=32)
    return {"leaves": to_image(green * (0.45 + 1.1 * leaves[..., None]))}


CLASS = AssetClass("hedge", None, {"standard": Variant(section.box(LENGTH_M, WIDTH_M, CORNER_M), shape, paint)})
