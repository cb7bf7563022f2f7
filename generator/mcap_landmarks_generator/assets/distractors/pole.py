"""Pole: a lamp post or a post with a plain sign, neither red nor octagonal."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, ellipsoid, lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain

POLE_M = 0.06


def shape(rng: np.random.Generator) -> list[Solid]:
    """A pole of 1.6 to 3.5 m with a ball or a rectangular sign on top, or bare."""
    height = rng.uniform(1.6, 3.5)
    solids = [
        lathe([(POLE_M, 0), (POLE_M, 0.3), (0.8 * POLE_M, height)], "pole", 14),
        lathe([(0.13, 0), (0.13, 0.03)], "pole", 14),
    ]
    kind = rng.integers(3)
    if kind == 0:
        solids.append(ellipsoid(0.36, 0.36, 0.36, "head", 14, 9).moved(z_m=height + 0.14))
    elif kind == 1:
        sign = box(0.02, rng.uniform(0.4, 0.8), rng.uniform(0.25, 0.6), "head")
        solids.append(sign.moved(POLE_M + 0.01, z_m=height - 0.3))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Metal or paint; the head in white, blue, yellow or green."""
    return {
        "pole": plain(rng, pick(rng, (grey(rng, 0.1, 0.75), hsv(0.36, 0.4, 0.3)))),
        "head": plain(
            rng, pick(rng, (grey(rng, 0.8, 0.97), hsv(0.6, 0.8, 0.7), hsv(0.14, 0.8, 0.9), hsv(0.36, 0.7, 0.5))), 64
        ),
    }


CLASS = AssetClass("pole", None, {"standard": Variant(section.disc(POLE_M), shape, paint)})
