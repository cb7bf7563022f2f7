"""Bank: a slope of grass behind a low wall, to tell what rises from what stands."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, loft
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, noise, plain, to_image

DEPTH_M, WIDTH_M = 4.0, 8.0
_WALL_M, _WALL_HEIGHT_M = 0.2, 0.3
_BEHIND_M = 0.25
"""Height at the ends of the slope's foot, above the band for which a section holds."""


def shape(rng: np.random.Generator) -> list[Solid]:
    """A slope that rises away from +x, by 0.5 to 0.9 m over four metres."""
    low, high = -DEPTH_M / 2, DEPTH_M / 2 - _WALL_M
    crest = _BEHIND_M + rng.uniform(0.5, 0.9)
    profile = np.array([(low, 0.0), (high, 0.0), (high, _BEHIND_M), (low, crest)])
    rings = [np.column_stack([profile[:, 0], np.full(4, y), profile[:, 1]]) for y in (WIDTH_M / 2, -WIDTH_M / 2)]
    wall = box(_WALL_M, WIDTH_M, _WALL_HEIGHT_M, "stone").moved(high + _WALL_M / 2, z_m=_WALL_HEIGHT_M / 2)
    return [loft(rings, "grass"), wall]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Grass and stone."""
    green = hsv(rng.uniform(0.2, 0.3), rng.uniform(0.4, 0.65), rng.uniform(0.35, 0.55))
    blades = noise(rng, 128, 256, octaves=3, cells=32)
    return {
        "grass": to_image(green * (0.7 + 0.6 * blades[..., None])),
        "stone": plain(rng, grey(rng, 0.4, 0.7), 64, 0.25),
    }


CLASS = AssetClass("bank", None, {"standard": Variant(section.box(DEPTH_M, WIDTH_M), shape, paint)})
