"""Chair: four straight legs, a seat, a back of slats or of one board, with or without armrests."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, lathe, limb, rounded_box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, vivid, wooden

LEG_M, LENGTH_M, WIDTH_M = 0.022, 0.38, 0.38


def shape(rng: np.random.Generator) -> list[Solid]:
    """A chair that faces +x, its seat at 0.43 to 0.48 m, its back 0.4 to 0.55 m higher."""
    seat, back = rng.uniform(0.43, 0.48), rng.uniform(0.40, 0.55)
    solids = [rounded_box(0.46, 0.46, 0.065, 0.04, "seat", 0.02).moved(z_m=seat)]
    for x in (1, -1):
        for y in (1, -1):
            leg = lathe([(LEG_M, 0), (LEG_M, 0.2), (0.8 * LEG_M, 0.23), (0.8 * LEG_M, seat)], "frame", 10)
            solids.append(leg.moved(x * LENGTH_M / 2, y * WIDTH_M / 2))
        rail = [(x * LENGTH_M / 2, -WIDTH_M / 2, 0.28), (x * LENGTH_M / 2, WIDTH_M / 2, 0.28)]
        solids.append(limb(rail, 0.009, "frame", 6))
    if rng.random() < 0.4:
        solids += _arms(seat)
    return solids + _back(rng, seat, back)


def _arms(seat: float) -> list[Solid]:
    """Armrests on a post in front."""
    solids = []
    for y in (0.22, -0.22):
        solids.append(box(0.42, 0.045, 0.03, "frame").moved(-0.01, y, seat + 0.21))
        solids.append(limb([(0.17, y, seat), (0.17, y, seat + 0.2)], 0.015, "frame", 6))
    return solids


def _back(rng: np.random.Generator, seat: float, back: float) -> list[Solid]:
    """Two posts that lean back, and what is between them."""
    lean = rng.uniform(0.08, 0.2)
    solids = []
    for y in (1, -1):
        post = [(-LENGTH_M / 2, y * WIDTH_M / 2, 0.0), (-LENGTH_M / 2 - back * lean, y * WIDTH_M / 2, back)]
        solids.append(limb(post, 0.020, "frame", 8).moved(z_m=seat))
    kind = rng.choice(3, p=[0.55, 0.3, 0.15])
    if kind == 0:
        parts = [(0.03, 0.36, back * 0.17, share) for share in (0.3, 0.6, 0.9)]
    elif kind == 1:
        parts = [(0.04, 0.42, back * 0.62, 0.68)]
    else:
        parts = [(0.03, 0.40, back * 0.16, 0.92)]
        for offset in (-0.12, -0.04, 0.04, 0.12):
            spindle = [(-LENGTH_M / 2, offset, 0.0), (-LENGTH_M / 2 - back * lean * 0.9, offset, back * 0.9)]
            solids.append(limb(spindle, 0.011, "frame", 6).moved(z_m=seat))
    for depth, width, height, share in parts:
        board = rounded_box(depth, width, height, 0.012, "seat", 0.01).turned((0, 1, 0), -np.arctan(lean))
        solids.append(board.moved(-LENGTH_M / 2 - back * lean * share, z_m=seat + back * share))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Wood, or a coloured seat on a painted or metal frame."""
    wood = hsv(rng.uniform(0.05, 0.1), rng.uniform(0.45, 0.7), rng.uniform(0.3, 0.7))
    if rng.random() < 0.2:
        return {"seat": wooden(rng, wood), "frame": wooden(rng, 0.85 * wood)}
    dark = grey(rng, 0.05, 0.18)
    colour = pick(rng, (vivid(rng, 0.2, 0.6), dark, dark, dark, dark, grey(rng, 0.5, 0.95)))
    frame = pick(rng, (0.85 * colour, 0.85 * colour, dark, dark, grey(rng, 0.6, 0.8)))
    return {"seat": plain(rng, colour, 64), "frame": plain(rng, frame)}


CLASS = AssetClass("chair", 56, {"standard": Variant(section.four_legs(LEG_M, LENGTH_M, WIDTH_M), shape, paint)})
