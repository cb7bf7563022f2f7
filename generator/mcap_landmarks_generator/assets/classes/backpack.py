"""Backpack: standing on its bottom, with pockets in front and at the sides, zips, a loop and shoulder straps."""

import numpy as np

from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.section import Box, Section
from mcap_landmarks_generator.assets.shapes import limb, rounded_box, rounded_rectangle, stack
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import (
    Colour,
    Image,
    grey,
    hsv,
    noise,
    pick,
    plain,
    stroke,
    to_image,
    vivid,
)

# The bag, two layers of pockets in front of it, and the side pockets: upright up to TOP_M, above the LiDAR's band.
BAG = Box(0.19, 0.33, x_m=-0.045, corner_m=0.06)
FRONT = Box(0.10, 0.29, x_m=0.055, corner_m=0.04)
POUCH = Box(0.06, 0.24, x_m=0.11, corner_m=0.025)
SIDES = (Box(0.11, 0.07, x_m=-0.04, y_m=0.165, corner_m=0.03), Box(0.11, 0.07, x_m=-0.04, y_m=-0.165, corner_m=0.03))
TOP_M = 0.21


def shape(rng: np.random.Generator) -> list[Solid]:
    """A pack of 0.46 to 0.56 m whose pockets point to +x."""
    height = rng.uniform(0.46, 0.56)
    front, pouch, side = height * rng.uniform(0.70, 0.80), rng.uniform(0.25, 0.28), rng.uniform(0.23, 0.27)
    solids = [
        _arched(BAG, height, "bag"),
        _arched(FRONT, front, "bag"),
        _arched(POUCH, pouch, "pouch"),
        _piping(FRONT, front),
        _piping(POUCH, pouch),
        *(_arched(pocket, side, "pouch") for pocket in SIDES),
    ]
    if rng.random() < 0.5:
        badge = rounded_box(0.012, 0.09, 0.05, 0.004, "badge", 0.004)
        solids.append(badge.moved(FRONT.x_m + 0.047, z_m=0.5 * (front + pouch) + 0.005))
    return solids + _straps(height)


def _arched(box: Box, height: float, material: str) -> Solid:
    """A stuffed bag on a box's footprint, its upper end rounded like a loaf."""
    levels = [(0.0, 0.88), (0.035, 1.0), (TOP_M, 1.0)]
    levels += [(TOP_M + (height - TOP_M) * t, np.sqrt(1 - 0.8 * t**5)) for t in (0.45, 0.75, 0.92, 1.0)]
    outlines = []
    for z, scale in levels:
        length, width = box.length_m * (0.4 + 0.6 * scale), box.width_m * scale
        outlines.append((z, rounded_rectangle(length, width, box.corner_m * scale, arc_points=3)))
    return stack(outlines, material).moved(box.x_m, box.y_m)


def _piping(box: Box, height: float) -> Solid:
    """The zip around a pocket: a dark edge that shows a little outside of its arch, above the LiDAR's band."""
    width = box.width_m / 2
    turn = np.linspace(0, np.pi, 12)
    x = np.full(12, box.x_m + 0.1 * box.length_m)
    start = TOP_M
    arch = np.column_stack(
        [x, 0.99 * width * np.cos(turn), start + (height - start - 0.004) * np.abs(np.sin(turn)) ** 0.6]
    )
    return limb(arch, np.tile([0.009, 0.006], (12, 1)), "piping", 5, front=(1, 0, 0))


def _straps(height: float) -> list[Solid]:
    """Shoulder straps that stand off the back, and the loop on top."""
    solids = []
    back = BAG.x_m - BAG.length_m / 2
    for side in (1, -1):
        path = [
            (back + 0.03, side * 0.06, height * 0.94),
            (back - 0.03, side * 0.09, height * 0.90),
            (back - 0.045, side * 0.13, height * 0.72),
            (back - 0.04, side * 0.16, height * 0.55),
            (back - 0.01, side * 0.15, 0.25),
            (back + 0.03, side * 0.13, 0.21),
        ]
        solids.append(limb(path, np.tile([0.014, 0.032], (6, 1)), "strap", 8))
    turn = np.linspace(0, np.pi, 6)
    loop = np.column_stack([np.full(6, BAG.x_m - 0.03), 0.045 * np.cos(turn), height - 0.02 + 0.05 * np.sin(turn)])
    return [*solids, limb(loop, 0.009, "strap", 6)]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Cloth in one dark colour with folds, light zips, and black straps."""
    dark = pick(rng, (grey(rng, 0.06, 0.13), grey(rng, 0.06, 0.13), hsv(0.62, rng.uniform(0.4, 0.7), 0.22)))
    colour = pick(rng, (dark, dark, dark, dark, hsv(rng.uniform(-0.02, 0.02), 0.8, 0.4)))
    return {
        "bag": _creased(rng, colour, grey(rng, 0.3, 0.5)),
        "pouch": _creased(rng, 0.85 * colour, grey(rng, 0.3, 0.5)),
        "badge": plain(rng, pick(rng, (grey(rng, 0.7, 0.95), vivid(rng)))),
        "piping": plain(rng, pick(rng, (grey(rng, 0.35, 0.6), 0.3 * colour))),
        "strap": plain(rng, grey(rng, 0.05, 0.12)),
    }


def _creased(rng: np.random.Generator, colour: Colour, zip_colour: Colour) -> Image:
    """Cloth that hangs in folds, lighter towards the top, with the line of a zip around it."""
    size_px = 128
    v = 1 - (np.arange(size_px) + 0.5) / size_px
    folds = 1 + 1.0 * (noise(rng, size_px, size_px, octaves=5, cells=4) - 0.5)
    lit = np.interp(v, [0.0, 0.2, 0.7, 1.0], [0.7, 0.9, 1.1, 1.9])
    image = to_image(colour * (folds * lit[:, None])[..., None])
    stroke(image, [(0.0, 0.55), (1.0, 0.55)], 0.016, 0.4 * colour)
    stroke(image, [(0.0, 0.53), (1.0, 0.53)], 0.016, zip_colour)
    return image


CLASS = AssetClass("backpack", 24, {"standard": Variant(Section((BAG, FRONT, POUCH, *SIDES)), shape, paint)})
