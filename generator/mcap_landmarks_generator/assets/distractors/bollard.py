"""Bollard: a round post with a reflecting band."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, pick, plain, vivid

POST_M = 0.10


def shape(rng: np.random.Generator) -> list[Solid]:
    """A post of 0.6 to 1.1 m with a flat or a round top."""
    r, h = POST_M, rng.uniform(0.6, 1.1)
    top = [(r * 0.92, h), (r * 0.6, h + 0.04), (r * 0.2, h + 0.06)] if rng.random() < 0.5 else [(r, h)]
    return [
        lathe([(r, 0), (r, 0.8 * h), *[(x, z) for x, z in top]], "post", 20),
        lathe([(1.04 * r, 0.68 * h), (1.04 * r, 0.8 * h)], "band", 20),
    ]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Grey, black or coloured, with a bright band."""
    return {
        "post": plain(rng, pick(rng, (grey(rng, 0.1, 0.8), grey(rng, 0.1, 0.8), vivid(rng)))),
        "band": plain(rng, pick(rng, (grey(rng, 0.8, 0.97), vivid(rng, 0.8)))),
    }


CLASS = AssetClass("bollard", None, {"standard": Variant(section.disc(POST_M), shape, paint)})
