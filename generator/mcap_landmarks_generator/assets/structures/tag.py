"""Tag: a board with an AprilTag (family 36h11) that stands on the floor; its variant is the tag's number."""

from functools import partial

import cv2
import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, plain

WIDTH_M, DEPTH_M = 0.30, 0.03
NUMBERS = range(12)
_CELLS, _CELL_PX = 8, 12
"""The family's tags are eight cells wide, their black border included; a white cell stands around it."""
TAG_M = WIDTH_M * _CELLS / (_CELLS + 2)


def shape(rng: np.random.Generator) -> list[Solid]:
    """A board that faces along +x, its tag's middle at 0.19 to 0.25 m."""
    foot_m = rng.uniform(0.04, 0.10)
    solids = [box(DEPTH_M, WIDTH_M, foot_m, "foot").moved(z_m=foot_m / 2)]
    back = box(0.6 * DEPTH_M, WIDTH_M, WIDTH_M, "foot").moved(-0.2 * DEPTH_M, z_m=foot_m + WIDTH_M / 2)
    front = box(0.4 * DEPTH_M, WIDTH_M, WIDTH_M, "tag").moved(0.3 * DEPTH_M, z_m=foot_m + WIDTH_M / 2)
    return [*solids, back, front]


def paint(number: int, rng: np.random.Generator) -> dict[str, Image]:
    """The tag in black on white."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    marker = cv2.aruco.generateImageMarker(family, number, _CELLS * _CELL_PX)
    sheet = np.pad(marker, _CELL_PX, constant_values=255).astype(np.float64)
    printed = np.clip(20 + 0.85 * sheet, 0, 255).astype(np.uint8)
    return {"tag": np.repeat(printed[..., None], 3, axis=2), "foot": plain(rng, grey(rng, 0.2, 0.5))}


CLASS = AssetClass(
    "tag", None, {str(i): Variant(section.box(DEPTH_M, WIDTH_M), shape, partial(paint, i)) for i in NUMBERS}
)
