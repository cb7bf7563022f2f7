"""Table: a board on four legs."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, wooden

LEG_M, LENGTH_M, WIDTH_M = 0.03, 0.62, 1.10


def shape(rng: np.random.Generator) -> list[Solid]:
    """A table of 0.68 to 0.78 m."""
    height = rng.uniform(0.68, 0.78)
    board = box(LENGTH_M + rng.uniform(0.1, 0.2), WIDTH_M + rng.uniform(0.1, 0.25), 0.04, "board")
    solids = [board.moved(z_m=height), box(LENGTH_M, WIDTH_M, 0.07, "leg").moved(z_m=height - 0.055)]
    for x in (1, -1):
        for y in (1, -1):
            leg = lathe([(LEG_M, 0), (LEG_M, height - 0.02)], "leg", 10)
            solids.append(leg.moved(x * LENGTH_M / 2, y * WIDTH_M / 2))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Wood on wood or on metal."""
    wood = hsv(rng.uniform(0.05, 0.11), rng.uniform(0.3, 0.65), rng.uniform(0.35, 0.85))
    return {
        "board": wooden(rng, pick(rng, (wood, wood, grey(rng, 0.5, 0.95))), 64, grain=5),
        "leg": plain(rng, pick(rng, (0.85 * wood, grey(rng, 0.1, 0.8)))),
    }


CLASS = AssetClass("table", None, {"standard": Variant(section.four_legs(LEG_M, LENGTH_M, WIDTH_M), shape, paint)})
