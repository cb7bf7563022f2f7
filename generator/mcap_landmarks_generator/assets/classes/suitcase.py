"""Suitcase: an upright ribbed trolley with round corners, a dark seam, four castors, and handles."""

from dataclasses import replace

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, limb, rounded_box, rounded_rectangle, stack, torus
from mcap_landmarks_generator.assets.solid import Floats, Solid, vector
from mcap_landmarks_generator.assets.texture import (
    Colour,
    Image,
    grey,
    hsv,
    pick,
    plain,
    to_image,
    weathered,
)

DEPTH_M, WIDTH_M, CORNER_M = 0.28, 0.50, 0.04
FLOOR_M = 0.05
# Radius of the corners as they are seen from the front.
ROUND_M = 0.08
# What lies where on a half of the shell's picture, as shares of its width: from a corner around a narrow side to the
# end of a large face. The other half of the way around is the same.
_SIDE_U, _FACE_U = (0.085, 0.346), (0.431, 1.0)
_HALF_PX = 128


def shape(rng: np.random.Generator) -> list[Solid]:
    """A case of 0.5 to 0.66 m without its handle, which is mostly down, at times pulled out by up to 0.25 m."""
    height = rng.uniform(0.50, 0.66)
    middle = FLOOR_M + height / 2
    top = FLOOR_M + height
    solids = [_body(height), _seam(height)]
    solids += _handles(rng, top, middle)
    for x in (1, -1):
        for y in (1, -1):
            place = np.array([x * DEPTH_M * 0.36, y * WIDTH_M * 0.41, 0.0])
            solids.append(box(0.05, 0.05, 0.03, "rubber").moved(*(place + vector(0, 0, FLOOR_M - 0.01))))
            solids.append(torus(0.018, 0.01, "rubber", sides=10, tube_sides=5).moved(*(place + vector(0, 0, 0.028))))
    return solids


def _body(height: float) -> Solid:
    """The shell; its picture goes around it by length and up by height."""
    turn = np.linspace(0.0, np.pi / 2, 5)
    levels = []
    for inset, depth in zip(1 - np.sin(turn), 1 - np.cos(turn), strict=True):
        width, length = WIDTH_M - 2 * ROUND_M * inset, DEPTH_M - 0.002 - 0.06 * inset
        outline = rounded_rectangle(length, width, CORNER_M * (1 - 0.5 * inset))
        levels.append((height / 2 - ROUND_M * depth, outline))
    solid = stack([(-z, outline) for z, outline in levels] + levels[::-1], "shell")
    outline = rounded_rectangle(DEPTH_M - 0.002, WIDTH_M, CORNER_M)
    closed = np.concatenate([outline, outline[:1]])
    around = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    u = np.tile(around / around[-1], len(solid.vertices) // len(around))
    uv = np.column_stack([u, solid.vertices[:, 2] / height + 0.5])
    return replace(solid, uv=uv).moved(z_m=FLOOR_M + height / 2)


def _seam(height: float) -> Solid:
    """The dark frame between the two halves, in the plane x = 0."""
    outline = rounded_rectangle(WIDTH_M + 0.006, height + 0.006, ROUND_M)
    band = stack([(-0.011, outline), (0.011, outline)], "edge")
    # The outline's x becomes the case's y, its y the case's z.
    return replace(band, vertices=band.vertices[:, [2, 0, 1]]).moved(z_m=FLOOR_M + height / 2)


def _handles(rng: np.random.Generator, top: float, middle: float) -> list[Solid]:
    """The telescopic handle, and the carrying handles on top and on one side."""
    pulled = rng.choice([0.03, rng.uniform(0.08, 0.25)], p=[0.85, 0.15])
    x = -DEPTH_M * 0.32
    solids = [limb([(x, side * 0.1, top - 0.02), (x, side * 0.1, top + pulled)], 0.012, "metal", 6) for side in (1, -1)]
    solids.append(rounded_box(0.036, 0.25, 0.036, 0.01, "rubber", 0.01).moved(x, z_m=top + pulled))
    grip = [(0.03, -0.11, top - 0.01), (0.03, -0.08, top + 0.04), (0.03, 0.08, top + 0.04), (0.03, 0.11, top - 0.01)]
    solids.append(limb(grip, np.tile([0.014, 0.02], (4, 1)), "rubber", 6))
    y = WIDTH_M / 2
    grip = [
        (0, y - 0.01, middle - 0.1),
        (0, y + 0.03, middle - 0.07),
        (0, y + 0.03, middle + 0.07),
        (0, y - 0.01, middle + 0.1),
    ]
    solids.append(limb(grip, 0.012, "rubber", 6))
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """A ribbed shell in black, grey, blue or red; edges and handles are dark."""
    dark = pick(rng, (grey(rng, 0.10, 0.22), grey(rng, 0.10, 0.22), hsv(0.62, 0.6, rng.uniform(0.2, 0.45))))
    red = hsv(rng.uniform(-0.03, 0.01), rng.uniform(0.7, 0.9), rng.uniform(0.3, 0.5))
    blue = hsv(rng.uniform(0.52, 0.62), 0.6, 0.45)
    shell = pick(rng, (dark, dark, dark, dark, blue, blue, grey(rng, 0.2, 0.35), red))
    half = _ribbed(rng, shell)
    return {
        "shell": weathered(rng, np.concatenate([half, half], axis=1), 0.12),
        "edge": plain(rng, 0.3 * shell),
        "rubber": plain(rng, grey(rng, 0.05, 0.12)),
        "metal": plain(rng, pick(rng, (grey(rng, 0.15, 0.3), grey(rng, 0.55, 0.8)))),
    }


def _ribbed(rng: np.random.Generator, colour: Colour) -> Image:
    """Half of the way around a shell: grooves on face and side, light where it bends to the sky."""
    count = int(rng.integers(5, 10))
    u = (np.arange(_HALF_PX) + 0.5) / _HALF_PX
    v = 1 - u
    across = np.interp(u, [*_SIDE_U, *_FACE_U], [0.0, 3.0, 0.0, float(count)]) % 1
    # One rib: a groove, a lit flank, and its back that darkens towards the next groove.
    rib = np.interp(across, [0.0, 0.1, 0.2, 0.35, 0.85, 1.0], [0.45, 0.55, 1.45, 1.1, 0.9, 0.45])
    inside = (u > _SIDE_U[0]) & (u < _SIDE_U[1]) | (u > _FACE_U[0])
    rows = np.interp(v, [0.0, 0.08, 0.12, 0.88, 0.92, 0.97, 1.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    relief = 1 + rows[:, None] * np.where(inside, rib - 1, 0.0)[None, :]
    return to_image(colour * relief[..., None] * _lit(v)[:, None, None])


def _lit(v: Floats) -> Floats:
    """Light by height: less near the ground, more on the edge that bends to the sky."""
    return np.asarray(np.interp(v, [0.0, 0.1, 0.5, 0.9, 0.95, 1.0], [0.55, 0.8, 1.0, 1.1, 1.35, 1.15]))


CLASS = AssetClass("suitcase", 28, {"standard": Variant(section.box(DEPTH_M, WIDTH_M, CORNER_M), shape, paint)})
