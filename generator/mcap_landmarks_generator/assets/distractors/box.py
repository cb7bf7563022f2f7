"""Box: a carton or a crate."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, rectangle, vivid, weathered, wooden

LENGTH_M, WIDTH_M = 0.45, 0.60


def shape(rng: np.random.Generator) -> list[Solid]:
    """A box of 0.3 to 0.9 m, sometimes with a smaller one on top."""
    height = rng.uniform(0.3, 0.9)
    solids = [box(LENGTH_M, WIDTH_M, height, "side").moved(z_m=height / 2)]
    if rng.random() < 0.4:
        upper = box(0.7 * LENGTH_M, 0.6 * WIDTH_M, 0.25, "side").turned((0, 0, 1), rng.uniform(-0.3, 0.3))
        solids.append(upper.moved(y_m=rng.uniform(-0.08, 0.08), z_m=height + 0.125))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Cardboard with tape, boards, or plain paint."""
    kind = rng.integers(3)
    if kind == 0:
        image = plain(rng, hsv(rng.uniform(0.07, 0.1), rng.uniform(0.35, 0.55), rng.uniform(0.5, 0.8)), 64)
        rectangle(image, (0.0, 0.44), (1.0, 0.54), grey(rng, 0.6, 0.85))
        return {"side": image}
    if kind == 1:
        boards = wooden(rng, hsv(rng.uniform(0.06, 0.1), rng.uniform(0.4, 0.6), rng.uniform(0.45, 0.75)), 64)
        for gap in (0.25, 0.5, 0.75):
            rectangle(boards, (0.0, gap - 0.012), (1.0, gap + 0.012), (40, 30, 22))
        return {"side": weathered(rng, boards)}
    return {"side": plain(rng, pick(rng, (vivid(rng), grey(rng, 0.1, 0.9))), 64)}


CLASS = AssetClass("box", None, {"standard": Variant(section.box(LENGTH_M, WIDTH_M), shape, paint)})
