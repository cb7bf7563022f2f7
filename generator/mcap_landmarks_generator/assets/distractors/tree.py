"""Tree: a trunk under a crown of leafy balls, or a fir's tiers."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import ellipsoid, lathe
from mcap_landmarks_generator.assets.solid import Solid, vector
from mcap_landmarks_generator.assets.texture import Image, hsv, plain, wooden

TRUNK_M = 0.10


def shape(rng: np.random.Generator) -> list[Solid]:
    """A tree of 2 to 4 m; the trunk is straight up to LiDAR height and above."""
    height = rng.uniform(1.0, 1.8)
    solids = [lathe([(1.25 * TRUNK_M, 0), (TRUNK_M, 0.08), (TRUNK_M, 0.25), (0.6 * TRUNK_M, height + 0.3)], "bark", 14)]
    if rng.random() < 0.3:
        for tier in range(4):
            reach = 0.75 - 0.15 * tier
            low = 0.6 * height + 0.45 * tier
            solids.append(lathe([(0.2 * reach, low), (reach, low + 0.02), (0.05, low + 0.8)], "leaves", 14))
        return solids
    for _ in range(int(rng.integers(4, 8))):
        size = rng.uniform(0.7, 1.3)
        place = rng.normal(0, 0.3, 3) * (1, 1, 0.7) + vector(0, 0, height + 0.55)
        solids.append(ellipsoid(size, size, 0.8 * size, "leaves", 11, 7).moved(*place))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Brown bark, green or autumn leaves."""
    hue = rng.uniform(0.2, 0.38) if rng.random() < 0.85 else rng.uniform(0.04, 0.14)
    return {
        "bark": wooden(rng, hsv(rng.uniform(0.05, 0.1), rng.uniform(0.2, 0.5), rng.uniform(0.25, 0.5)), 64),
        "leaves": plain(rng, hsv(hue, rng.uniform(0.4, 0.8), rng.uniform(0.25, 0.6)), 64, mottle=0.4),
    }


CLASS = AssetClass("tree", None, {"standard": Variant(section.disc(TRUNK_M), shape, paint)})
