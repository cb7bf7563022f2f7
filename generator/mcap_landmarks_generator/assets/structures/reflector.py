"""Reflector: a post wrapped in reflecting sheet, as automated trucks navigate by."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, plain

POST_M = 0.04


def shape(rng: np.random.Generator) -> list[Solid]:
    """A post of 1.2 to 1.8 m under a dark cap."""
    height = rng.uniform(1.2, 1.8)
    return [
        lathe([(POST_M, 0.0), (POST_M, height)], "sheet", 20),
        lathe([(1.1 * POST_M, height), (1.1 * POST_M, height + 0.02)], "cap", 20),
    ]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Silver sheet."""
    return {"sheet": plain(rng, grey(rng, 0.75, 0.9), 32, 0.05), "cap": plain(rng, grey(rng, 0.05, 0.2))}


CLASS = AssetClass("reflector", None, {"standard": Variant(section.disc(POST_M), shape, paint)})
