"""Backpack: standing on its bottom, with front and side pockets, zips, a carrying loop and shoulder straps behind."""

import numpy as np

from generator.assets import section
from generator.assets.asset import AssetClass
from generator.assets.shapes import limb, rounded_box, rounded_rectangle, stack
from generator.assets.solid import Solid
from generator.assets.texture import Image, grey, pick, plain, to_image, vivid

DEPTH_M, WIDTH_M, CORNER_M = 0.24, 0.36, 0.07


def shape(variant: str, rng: np.random.Generator) -> list[Solid]:
    """A pack of 0.48 to 0.6 m whose pockets point to +x."""
    height = rng.uniform(0.48, 0.60)
    low = rng.uniform(0.215, 0.25)
    solids = [_bag(height), _front_pocket(low), *_straps(height)]
    if rng.random() < 0.7:
        upper = height * 0.80
        pocket = rounded_box(0.10, WIDTH_M * 0.62, upper - low - 0.03, 0.035, "pocket", 0.03)
        solids.append(pocket.moved(0.085, z_m=(upper + low) / 2 + 0.01))
    return solids


def _bag(height: float) -> Solid:
    """The main bag: straight up to where the pockets end, then rounded like a loaf."""
    levels = [(0.0, 0.86), (0.015, 0.96), (0.05, 1.0), (0.22, 1.0)]
    levels += [(0.22 + (height - 0.22) * t, np.sqrt(1 - 0.92 * t**3.2)) for t in (0.35, 0.6, 0.78, 0.9, 0.97, 1.0)]
    # The front pocket fills the section up to DEPTH_M in front of the bag, so the bag itself sits further back.
    outlines = []
    for z, scale in levels:
        outline = rounded_rectangle(DEPTH_M * (0.5 + 0.5 * scale), WIDTH_M * scale, CORNER_M * scale, arc_points=5)
        outlines.append((z, outline - (DEPTH_M * 0.25 * (1 - scale), 0)))
    return stack(outlines, "bag")


def _front_pocket(top: float) -> Solid:
    """The lower pocket: a bulge around the section's front above the band in which the section is declared."""
    return rounded_box(0.10, WIDTH_M * 0.8, top - 0.03, 0.04, "pocket", 0.03).moved(0.07, z_m=top / 2 + 0.02)


def _straps(height: float) -> list[Solid]:
    """Shoulder straps close to the back, and the loop on top."""
    solids = []
    back = -DEPTH_M / 2
    for side in (1, -1):
        path = [
            (back + 0.03, side * 0.06, height * 0.90), (back - 0.045, side * 0.075, height * 0.83),
            (back - 0.06, side * 0.095, height * 0.6), (back - 0.02, side * 0.12, 0.23), (back + 0.02, side * 0.13, 0.2),
        ]  # fmt: skip
        solids.append(limb(path, np.tile([0.012, 0.03], (5, 1)), "strap", 8))
    turn = np.linspace(0, np.pi, 6)
    loop = np.column_stack([np.full(6, back * 0.45), 0.045 * np.cos(turn), height - 0.02 + 0.055 * np.sin(turn)])
    return [*solids, limb(loop, 0.010, "strap", 6)]


def paint(variant: str, rng: np.random.Generator) -> dict[str, Image]:
    """Two tones of cloth with dark zips."""
    cloth = pick(rng, (vivid(rng, 0.2, 0.8), vivid(rng, 0.2, 0.8), grey(rng, 0.08, 0.35)))
    pocket = pick(rng, (0.8 * cloth, 0.8 * cloth, vivid(rng), grey(rng, 0.1, 0.4)))
    return {
        "bag": plain(rng, cloth, 64, mottle=0.2),
        "pocket": _zipped(plain(rng, pocket, 64, mottle=0.15), rng),
        "strap": plain(rng, grey(rng, 0.05, 0.18)),
    }


def _zipped(image: Image, rng: np.random.Generator) -> Image:
    """A pocket's cloth with a zip all around below its upper edge."""
    rows = np.arange(len(image)) / len(image)
    zipped = np.abs(rows - 0.27) < 0.025
    image[zipped] = to_image(grey(rng, 0.05, 0.2))
    return image


CLASS = AssetClass("backpack", 24, {"standard": section.box(DEPTH_M, WIDTH_M, CORNER_M)}, shape, paint)
