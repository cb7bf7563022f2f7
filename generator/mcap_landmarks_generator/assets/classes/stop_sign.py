"""Stop sign: a red octagon with white border and letters, on a post that stands in the ground or in a round foot."""

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe, stack
from mcap_landmarks_generator.assets.solid import Floats, Solid
from mcap_landmarks_generator.assets.texture import Image, canvas, grey, hsv, pick, plain, polygon, stroke, weathered

POST_M = 0.04
FOOT_M = 0.20


def _arc(centre: tuple[float, float], radii: tuple[float, float], start_deg: float, end_deg: float) -> Floats:
    """Points of an elliptical arc."""
    angle = np.deg2rad(np.linspace(start_deg, end_deg, 20))
    return np.column_stack([np.cos(angle), np.sin(angle)]) * radii + centre


# The strokes of S, T, O and P, each letter in a unit square.
_LETTERS: tuple[list[ArrayLike], ...] = (
    [np.concatenate([_arc((0.5, 0.75), (0.5, 0.25), 15, 270), _arc((0.5, 0.25), (0.5, 0.25), 90, -165)])],
    [[(-0.05, 1), (1.05, 1)], [(0.5, 1), (0.5, 0)]],
    [_arc((0.5, 0.5), (0.5, 0.5), 0, 360)],
    [[(0, 0), (0, 1), (0.6, 1), *_arc((0.6, 0.74), (0.4, 0.26), 90, -90), (0, 0.48)]],
)


def shape(footed: bool, rng: np.random.Generator) -> list[Solid]:
    """A sign 0.75 to 0.9 m across, its face towards +x, its lower edge 1.2 to 1.7 m above ground."""
    half = rng.uniform(0.375, 0.45)
    centre = rng.uniform(1.2, 1.7) + half
    face = _plate(half, "face").moved(POST_M + 0.006, z_m=centre)
    back = _plate(half * 0.995, "back").moved(POST_M, z_m=centre)
    post = lathe([(POST_M, 0.0), (POST_M, centre + 0.8 * half)], "post", sides=12).unlabelled()
    solids = [face, back, post]
    if footed:
        foot = [(FOOT_M, 0.0), (FOOT_M, 0.24), (0.8 * FOOT_M, 0.29), (POST_M, 0.30)]
        solids.append(lathe(foot, "foot", sides=24).unlabelled())
    return solids


def _plate(half: float, material: str) -> Solid:
    """A thin octagon in the plane x = 0; seen from +x the texture is upright."""
    # An octagon whose upright edges lie at +-half.
    octagon = _octagon() * half
    plate = stack([(0.0, octagon), (0.006, octagon)], material)
    # The outline's x becomes the sign's y (its left, seen from behind), the outline's y its z.
    x, y, z = plate.vertices.T
    turned = Solid(np.column_stack([z, x, y]), plate.uv, plate.faces, material)
    uv = np.column_stack([turned.vertices[:, 1], turned.vertices[:, 2]]) / (2 * half) + 0.5
    return Solid(turned.vertices, uv, turned.faces, material)


def _octagon() -> Floats:
    """An octagon with edges at x, y = +-1."""
    angle = np.pi / 8 + np.pi / 4 * np.arange(8)
    return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / 8))


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """The face as prescribed, faded by its seed; letters a third of the sign's height."""
    red = hsv(rng.uniform(-0.01, 0.012), rng.uniform(0.82, 0.97), rng.uniform(0.68, 0.88))
    face = canvas((238, 238, 238), 512, 512)
    polygon(face, _octagon() * 0.475 + 0.5, red)
    for index, letter in enumerate(_LETTERS):
        for line in letter:
            stroke(face, np.asarray(line) * (0.135, 0.31) + (0.152 + 0.187 * index, 0.345), 0.052, (240, 240, 240))
    small = weathered(rng, face.reshape(128, 4, 128, 4, 3).mean(axis=(1, 3)).astype(np.uint8), 0.08)
    return {
        "face": small,
        "back": plain(rng, grey(rng, 0.45, 0.7)),
        "post": plain(rng, pick(rng, (grey(rng, 0.45, 0.8), hsv(0.35, 0.35, 0.35)))),
        "foot": plain(rng, grey(rng, 0.35, 0.7)),
    }


VARIANTS = {
    "post": Variant(section.disc(POST_M), partial(shape, False), paint),
    "foot": Variant(section.disc(FOOT_M), partial(shape, True), paint),
}
CLASS = AssetClass("stop sign", 11, VARIANTS)
