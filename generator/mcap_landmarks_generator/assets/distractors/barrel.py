"""Barrel: a steel drum with two beads, painted in any colour."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, pick, plain, striped, vivid

DRUM_M = 0.28


def shape(rng: np.random.Generator) -> list[Solid]:
    """A drum of 0.7 to 0.95 m."""
    r, h = DRUM_M, rng.uniform(0.70, 0.95)
    profile = [(r, 0), (r, h * 0.35), (r * 1.04, h * 0.36), (r * 1.04, h * 0.38), (r, h * 0.39)]
    profile += [
        (r, h * 0.66),
        (r * 1.04, h * 0.67),
        (r * 1.04, h * 0.69),
        (r, h * 0.70),
        (r, h),
        (r * 0.95, h),
        (r * 0.95, h - 0.02),
    ]
    return [lathe(profile, "drum", 28)]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """One colour, or two bands."""
    colour = pick(rng, (vivid(rng), vivid(rng), grey(rng, 0.2, 0.7)))
    if rng.random() < 0.3:
        return {"drum": striped(rng, (colour, pick(rng, (vivid(rng), grey(rng, 0.1, 0.9)))), int(rng.integers(1, 4)))}
    return {"drum": plain(rng, colour, 64, mottle=0.25)}


CLASS = AssetClass("barrel", None, {"standard": Variant(section.disc(DRUM_M), shape, paint)})
