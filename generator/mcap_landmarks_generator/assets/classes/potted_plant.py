"""Potted plant: a round pot and a rosette of curved leaves, or a small bush on a stem."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe, sheet
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain, vivid

POT_M = 0.18


def shape(rng: np.random.Generator) -> list[Solid]:
    """A pot of 0.28 to 0.36 m and leaves that reach 0.4 to 0.8 m above it."""
    rim = rng.uniform(0.28, 0.36)
    pot = [(0.86 * POT_M, 0), (0.985 * POT_M, 0.1), (1.02 * POT_M, 0.21), (1.05 * POT_M, rim - 0.05)]
    solids = [
        lathe(pot, "pot", 20),
        lathe([(1.08 * POT_M, rim - 0.055), (1.16 * POT_M, rim - 0.05), (1.16 * POT_M, rim)], "pot", 20),
        lathe([(0.0, rim), (1.02 * POT_M, rim + 0.004), (0.6 * POT_M, rim + 0.015)], "soil", 12),
    ]
    reach = rng.uniform(0.4, 0.8)
    count = int(rng.integers(20, 30))
    for index in range(count):
        tilt = rng.uniform(0.05, 0.35) + 0.9 * index / count
        leaf = _leaf(rng, reach * rng.uniform(0.7, 1.1), tilt, f"leaf{index % 2}")
        solids.append(leaf.turned((0, 0, 1), index * 2.4 + rng.uniform(-0.3, 0.3)).moved(z_m=rim - 0.01))
    return solids


def _leaf(rng: np.random.Generator, length: float, tilt: float, material: str) -> Solid:
    """A leaf that rises from the origin, `tilt` off the vertical, and bends over to +x; folded along its middle."""
    along = np.linspace(0, 1, 6)
    angle = tilt * (0.5 + 1.1 * along)
    step = length / (len(along) - 1)
    x = np.concatenate([[0.0], np.cumsum(np.sin(angle[:-1]) * step)]) + 0.02
    z = np.concatenate([[0.0], np.cumsum(np.cos(angle[:-1]) * step)])
    half = length * rng.uniform(0.10, 0.18) * np.sin(np.pi * (0.1 + 0.9 * along)) ** 0.8
    points = np.empty((len(along), 3, 3))
    for index, side in enumerate((-1.0, 0.0, 1.0)):
        points[:, index] = np.column_stack(
            [x - abs(side) * half * 0.3 * np.cos(angle), side * half, z + abs(side) * half * 0.3]
        )
    return sheet(points, material)


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Greens of two tones; pots of clay, or in any colour."""
    green = hsv(rng.uniform(0.23, 0.36), rng.uniform(0.5, 0.85), rng.uniform(0.3, 0.65))
    clay = hsv(rng.uniform(0.03, 0.06), rng.uniform(0.5, 0.7), rng.uniform(0.55, 0.8))
    return {
        "pot": plain(rng, pick(rng, (clay, clay, grey(rng, 0.2, 0.95), vivid(rng)))),
        "soil": plain(rng, (66, 48, 34), mottle=0.3),
        "leaf0": plain(rng, green, mottle=0.2),
        "leaf1": plain(rng, green * rng.uniform(0.7, 1.15), mottle=0.2),
    }


CLASS = AssetClass("potted plant", 58, {"standard": Variant(section.disc(POT_M), shape, paint)})
