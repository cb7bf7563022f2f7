"""Suitcase: an upright trolley with ribs, dark edges, four castors, a side handle and a telescopic handle."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, limb, rounded_box, torus
from mcap_landmarks_generator.assets.solid import Solid, vector
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, vivid

DEPTH_M, WIDTH_M, CORNER_M = 0.28, 0.50, 0.04
FLOOR_M = 0.06


def shape(rng: np.random.Generator) -> list[Solid]:
    """A case of 0.46 to 0.62 m without its handle, which is pulled out by 0.02 to 0.4 m."""
    height = rng.uniform(0.46, 0.62)
    middle = FLOOR_M + height / 2
    top = FLOOR_M + height
    body = rounded_box(DEPTH_M - 0.007, WIDTH_M, height, CORNER_M, "shell", 0.045).moved(z_m=middle)
    solids = [body, box(0.022, WIDTH_M + 0.006, height + 0.004, "edge").moved(z_m=middle)]
    solids += _ribs(int(rng.integers(4, 8)), height, middle)
    solids += _handles(rng, top, middle)
    for x in (1, -1):
        for y in (1, -1):
            place = np.array([x * DEPTH_M * 0.36, y * WIDTH_M * 0.41, 0.0])
            solids.append(box(0.05, 0.05, 0.03, "rubber").moved(*(place + vector(0, 0, FLOOR_M - 0.01))))
            solids.append(torus(0.018, 0.01, "rubber", sides=10, tube_sides=5).moved(*(place + vector(0, 0, 0.028))))
    return solids


def _ribs(count: int, height: float, middle: float) -> list[Solid]:
    """Upright ribs on the two large faces."""
    pitch = (WIDTH_M - 0.10) / count
    ribs = []
    for index in range(count):
        across = (index - (count - 1) / 2) * pitch
        for side in (1, -1):
            rib = box(0.016, 0.5 * pitch, height - 0.12, "rib")
            ribs.append(rib.moved(side * (DEPTH_M / 2 - 0.007), across, middle))
    return ribs


def _handles(rng: np.random.Generator, top: float, middle: float) -> list[Solid]:
    """The telescopic handle, and the carrying handles on top and on one side."""
    pulled = rng.choice([0.02, rng.uniform(0.2, 0.4)])
    x = -DEPTH_M * 0.32
    solids = [limb([(x, side * 0.1, top - 0.02), (x, side * 0.1, top + pulled)], 0.010, "metal", 6) for side in (1, -1)]
    solids.append(rounded_box(0.034, 0.25, 0.032, 0.01, "rubber", 0.01).moved(x, z_m=top + pulled))
    grip = [(0.03, -0.09, top - 0.01), (0.03, -0.07, top + 0.028), (0.03, 0.07, top + 0.028), (0.03, 0.09, top - 0.01)]
    solids.append(limb(grip, 0.011, "rubber", 6))
    y = WIDTH_M / 2
    grip = [
        (0, y - 0.01, middle - 0.1),
        (0, y + 0.03, middle - 0.07),
        (0, y + 0.03, middle + 0.07),
        (0, y - 0.01, middle + 0.1),
    ]
    solids.append(limb(grip, 0.011, "rubber", 6))
    solids.append(box(0.008, 0.06, 0.03, "metal").moved(DEPTH_M / 2, 0.12, top - 0.08))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """A shell in a strong or a dark colour, its edges and handles darker."""
    dark = hsv(rng.random(), rng.uniform(0, 0.4), rng.uniform(0.08, 0.3))
    shell = pick(
        rng, (vivid(rng, 0.3, 0.7), dark, dark, grey(rng, 0.08, 0.2), grey(rng, 0.5, 0.8), hsv(0.6, 0.7, 0.35))
    )
    return {
        "shell": plain(rng, 0.85 * shell, 64, mottle=0.06),
        "rib": plain(rng, shell, mottle=0.04),
        "edge": plain(rng, 0.35 * shell),
        "rubber": plain(rng, grey(rng, 0.05, 0.16)),
        "metal": plain(rng, grey(rng, 0.6, 0.85)),
    }


CLASS = AssetClass("suitcase", 28, {"standard": Variant(section.box(DEPTH_M, WIDTH_M, CORNER_M), shape, paint)})
