"""Shelving: a bay of a pallet rack, empty or with goods on its floor and beams."""

from collections.abc import Sequence

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.section import Box, Disc, Section
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, rectangle, vivid, weathered, wooden

LENGTH_M, DEPTH_M, POST_M = 2.7, 0.9, 0.09
_BEAMS_M = (1.15, 2.2)
_GOODS_M = (2.3, 0.8)


def empty(rng: np.random.Generator) -> list[Solid]:
    """Four posts, two levels of beams and boards; the bay's long side lies along x."""
    height = _BEAMS_M[1] + rng.uniform(0.5, 0.9)
    solids = []
    for x in (1, -1):
        for y in (1, -1):
            post = box(POST_M, POST_M, height, "post")
            solids.append(post.moved(x * (LENGTH_M - POST_M) / 2, y * (DEPTH_M - POST_M) / 2, height / 2))
        for level in (0.6, 1.7):
            brace = box(0.04, DEPTH_M - 2 * POST_M, 0.04, "post")
            solids.append(brace.moved(x * (LENGTH_M - POST_M) / 2, z_m=level))
    for level in _BEAMS_M:
        for y in (1, -1):
            beam = box(LENGTH_M - 2 * POST_M, 0.05, 0.11, "beam")
            solids.append(beam.moved(y_m=y * (DEPTH_M - POST_M) / 2, z_m=level - 0.055))
        solids.append(box(LENGTH_M - 2 * POST_M, DEPTH_M - POST_M, 0.02, "board").moved(z_m=level + 0.01))
    return solids


def loaded(rng: np.random.Generator) -> list[Solid]:
    """The same with goods: on the floor a load as wide as the bay, on the beams some cartons."""
    floor_m = rng.uniform(0.6, 0.95)
    solids = [*empty(rng), box(*_GOODS_M, floor_m, "carton").moved(z_m=floor_m / 2)]
    for level in _BEAMS_M:
        for x in (-0.8, 0.0, 0.8):
            size = rng.uniform((0.4, 0.5, 0.3), (0.72, 0.75, 0.8))
            if rng.random() < 0.75:
                carton = box(size[0], size[1], size[2], "carton" if rng.random() < 0.6 else "crate")
                solids.append(carton.moved(x, z_m=level + 0.02 + size[2] / 2))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Blue or grey posts, orange beams, chipboard, cardboard with tape, and crates."""
    carton = plain(rng, hsv(rng.uniform(0.07, 0.1), rng.uniform(0.3, 0.5), rng.uniform(0.5, 0.8)), 64)
    rectangle(carton, (0.0, 0.45), (1.0, 0.53), grey(rng, 0.65, 0.85))
    rectangle(carton, (0.62, 0.12), (0.88, 0.34), grey(rng, 0.85, 0.97))
    return {
        "post": plain(rng, pick(rng, (hsv(0.6, 0.75, 0.5), grey(rng, 0.4, 0.7)))),
        "beam": plain(rng, hsv(rng.uniform(0.03, 0.08), 0.9, 0.9)),
        "board": wooden(rng, hsv(0.09, 0.3, 0.7)),
        "carton": weathered(rng, carton),
        "crate": plain(rng, pick(rng, (vivid(rng), grey(rng, 0.2, 0.8))), 64),
    }


def _posts(more: Sequence[Disc | Box] = ()) -> Section:
    x, y = (LENGTH_M - POST_M) / 2, (DEPTH_M - POST_M) / 2
    return Section((*more, *(Box(POST_M, POST_M, a * x, b * y) for a in (1, -1) for b in (1, -1))))


CLASS = AssetClass(
    "shelving",
    None,
    {"loaded": Variant(_posts(section.box(*_GOODS_M).shapes), loaded, paint), "empty": Variant(_posts(), empty, paint)},
)
