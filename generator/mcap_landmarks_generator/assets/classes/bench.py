"""Bench: slats for seat and back between two solid end frames, with or without armrests."""

import numpy as np

from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.section import Box, Section
from mcap_landmarks_generator.assets.shapes import box, limb
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, wooden

FRAME_LENGTH_M, FRAME_WIDTH_M, FRAME_Y_M = 0.38, 0.07, 0.58
SEAT_M = 0.44


def shape(rng: np.random.Generator) -> list[Solid]:
    """A bench of 1.4 to 1.9 m that faces +x."""
    length = rng.uniform(1.4, 1.9)
    slats, boards = int(rng.integers(3, 6)), int(rng.integers(2, 5))
    lean = rng.uniform(0.12, 0.3)
    solids = []
    for index in range(slats):
        depth = 0.44 / slats
        solids.append(box(0.82 * depth, length, 0.032, "wood").moved(-0.2 + depth * (index + 0.5), z_m=SEAT_M))
    for index in range(boards):
        height = 0.40 / boards
        up = 0.06 + height * (index + 0.5)
        board = box(0.028, length, 0.8 * height, "wood").turned((0, 1, 0), -lean)
        solids.append(board.moved(-0.2 - up * np.tan(lean), z_m=SEAT_M + up))
    arms = rng.random() < 0.5
    for side in (1, -1):
        solids += [solid.moved(y_m=side * FRAME_Y_M) for solid in _frame(lean, arms)]
    return solids


def _frame(lean: float, arms: bool) -> list[Solid]:
    """One end frame: a foot with two legs that carry the seat, the post of the back, and an armrest."""
    back = [(-0.19, 0, SEAT_M - 0.03), (-0.23 - 0.44 * np.tan(lean), 0, SEAT_M + 0.44)]
    solids = [
        box(FRAME_LENGTH_M, FRAME_WIDTH_M, 0.21, "frame").moved(z_m=0.105),
        limb([(0.15, 0, 0.2), (0.17, 0, SEAT_M - 0.02)], 0.026, "frame", 6),
        limb([(-0.15, 0, 0.2), (-0.18, 0, SEAT_M - 0.02)], 0.026, "frame", 6),
        limb(back, 0.026, "frame", 6),
    ]
    if arms:
        solids += [
            box(0.44, 0.05, 0.03, "frame").moved(-0.04, z_m=SEAT_M + 0.22),
            box(0.04, 0.04, 0.22, "frame").moved(0.15, z_m=SEAT_M + 0.11),
        ]
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Wood, or green paint, on iron or stone."""
    wood = hsv(rng.uniform(0.05, 0.1), rng.uniform(0.4, 0.75), rng.uniform(0.35, 0.75))
    boards = pick(rng, (wood, wood, wood, wood, wood, hsv(0.36, 0.5, 0.35)))
    # The grain runs along the bench, which is the texture's u on the faces that matter.
    return {
        "wood": wooden(rng, boards, 64, grain=3),
        "frame": plain(rng, pick(rng, (grey(rng, 0.06, 0.25), grey(rng, 0.06, 0.25), hsv(0.36, 0.5, 0.25)))),
    }


FEET = (Box(FRAME_LENGTH_M, FRAME_WIDTH_M, y_m=FRAME_Y_M), Box(FRAME_LENGTH_M, FRAME_WIDTH_M, y_m=-FRAME_Y_M))
CLASS = AssetClass("bench", 13, {"standard": Variant(Section(FEET), shape, paint)})
