"""Traffic light: a dark housing with three round lamps under visors, on a pole with a thick foot."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, lathe, rounded_box, surface
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, canvas, ellipse, grey, hsv, pick, plain, to_image

FOOT_M = 0.15
LAMPS = ("red", "amber", "green")
GLOW = {"red": (255, 45, 30), "amber": (255, 185, 40), "green": (60, 255, 140)}


def shape(rng: np.random.Generator) -> list[Solid]:
    """A housing of 0.9 to 1.1 m above a pole, its lamps towards +x, with or without a backplate."""
    scale = rng.uniform(0.9, 1.1)
    width, depth, height = 0.34 * scale, 0.22 * scale, 1.0 * scale
    low = rng.uniform(1.3, 1.9)
    housing = rounded_box(depth, width, height, 0.03, "housing", 0.02).moved(0.10, z_m=low + height / 2)
    solids = [housing]
    front = 0.10 + depth / 2
    for index, lamp in enumerate(LAMPS):
        solids += _lamp(lamp, 0.125 * scale, front, low + height * (5 - 2 * index) / 6)
    if rng.random() < 0.5:
        solids.append(box(0.012, width * 1.5, height * 1.18, "plate").moved(0.10 - depth * 0.2, z_m=low + height / 2))
    pole = [(0.06, 0.0), (0.055, low + height * rng.uniform(0.9, 1.1)), (0.03, low + height * 1.12)]
    foot = [(FOOT_M, 0.0), (FOOT_M, 0.30), (0.06, 0.36)]
    solids += [lathe(pole, "pole", 10).moved(-0.05).unlabelled(), lathe(foot, "pole", 24).unlabelled()]
    return solids


def _lamp(lamp: str, radius: float, front: float, height: float) -> list[Solid]:
    """Lens and visor."""
    lens = [(0.92 * radius, -0.01), (0.92 * radius, 0.012), (0.6 * radius, 0.028)]
    disc = _facing(lathe(lens, lamp, 16))
    return [solid.moved(front, z_m=height) for solid in (disc, _visor(radius, 0.2))]


def _facing(solid: Solid) -> Solid:
    """What pointed up now points along +x; its texture is projected from there."""
    turned = solid.turned((0, 1, 0), np.pi / 2)
    across = turned.vertices[:, 1:]
    uv = 0.5 + across / (2 * np.abs(across).max())
    return Solid(turned.vertices, uv, turned.faces, turned.material)


def _visor(radius: float, reach: float) -> Solid:
    """A bent plate around the lens, open below: long above, short at its ends."""
    turn = np.linspace(np.deg2rad(-35), np.deg2rad(215), 15)
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    length = reach * np.clip(0.45 + 0.55 * np.sin(turn), 0.1, 1.0)
    rows = []
    for scale, depth in ((1.0, 0 * length), (1.0, length), (0.94, length), (0.94, 0 * length), (1.0, 0 * length)):
        rows.append(np.column_stack([depth, scale * radius * rim]))
    plate = np.array(rows)
    ends = [plate[:, [side]].mean(axis=0, keepdims=True).repeat(5, axis=0) for side in (0, -1)]
    return surface(np.concatenate([ends[0], plate, ends[1]], axis=1), "housing")


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """A black, dark green or yellow housing; one lamp is lit."""
    housing = pick(rng, (grey(rng, 0.04, 0.14), grey(rng, 0.04, 0.14), hsv(0.4, 0.4, 0.2), hsv(0.13, 0.85, 0.8)))
    lit = rng.choice(LAMPS, p=[0.45, 0.1, 0.45])
    lamps = {lamp: _lens(GLOW[lamp], lit == lamp) for lamp in LAMPS}
    return {
        **lamps,
        "housing": plain(rng, housing, mottle=0.08),
        "plate": plain(rng, grey(rng, 0.03, 0.1)),
        "pole": plain(rng, pick(rng, (grey(rng, 0.3, 0.7), hsv(0.38, 0.4, 0.3), grey(rng, 0.05, 0.2)))),
    }


def _lens(colour: tuple[int, int, int], lit: bool) -> Image:
    """A lens, bright in its middle when lit and nearly black when not."""
    glow = np.asarray(colour, float)
    if not lit:
        return canvas(0.18 * glow + 12, 32, 32)
    image = canvas(glow, 32, 32)
    ellipse(image, (0.5, 0.55), (0.3, 0.3), glow + 0.5 * (255 - glow))
    return to_image(image)


CLASS = AssetClass("traffic light", 9, {"standard": Variant(section.disc(FOOT_M), shape, paint)})
