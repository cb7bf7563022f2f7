"""Glass: a pane in a frame of metal, through which LiDARs look."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import CLEAR, AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, plain

WIDTH_M, HEIGHT_M, FRAME_M, DEPTH_M, PANE_M = 2.0, 2.1, 0.05, 0.018, 0.01


def shape(_: np.random.Generator) -> list[Solid]:
    """A pane of 2 by 2.1 m that faces along x, with posts and rails around it."""
    rails = [box(DEPTH_M, WIDTH_M, FRAME_M, "frame").moved(z_m=z) for z in (FRAME_M / 2, HEIGHT_M - FRAME_M / 2)]
    side = (WIDTH_M - FRAME_M) / 2
    posts = [box(DEPTH_M, FRAME_M, HEIGHT_M, "frame").moved(y_m=y, z_m=HEIGHT_M / 2) for y in (-side, side)]
    return [*rails, *posts, box(PANE_M, WIDTH_M - 2 * FRAME_M, HEIGHT_M, CLEAR).moved(z_m=HEIGHT_M / 2)]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Bare or dark metal."""
    return {"frame": plain(rng, grey(rng, 0.15, 0.7)), CLEAR: plain(rng, grey(rng, 0.9, 1.0))}


CLASS = AssetClass("glass", None, {"standard": Variant(section.box(DEPTH_M, WIDTH_M), shape, paint)})
