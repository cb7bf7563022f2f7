"""Facade: the front of a house of two storeys, nine metres long, with windows, a door, sills and eaves."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, canvas, grey, hsv, pick, plain, rectangle, weathered

DEPTH_M, WIDTH_M, HEIGHT_M = 0.5, 9.0, 6.4
_BAYS_M = (-3.4, -1.2, 1.2, 3.4)
_STOREYS_M = (1.9, 4.6)
_WINDOW_M = (1.1, 1.4)
_DOOR_M = (1.1, 2.2)


def shape(rng: np.random.Generator) -> list[Solid]:
    """A wall whose front faces along +x; what stands out from it begins above the LiDAR."""
    front = DEPTH_M / 2
    solids = [box(DEPTH_M, WIDTH_M, HEIGHT_M, "wall").moved(z_m=HEIGHT_M / 2)]
    solids.append(box(0.7, WIDTH_M, rng.uniform(0.12, 0.25), "eaves").moved(front, z_m=HEIGHT_M))
    for storey, middle in enumerate(_STOREYS_M):
        for bay, place in enumerate(_BAYS_M):
            if (storey, bay) != (0, 1):
                sill = box(0.14, _WINDOW_M[0] + 0.2, 0.07, "eaves")
                solids.append(sill.moved(front + 0.05, place, middle - _WINDOW_M[1] / 2 - 0.04))
    canopy = box(0.8, _DOOR_M[0] + 0.5, 0.08, "eaves").moved(front + 0.3, _BAYS_M[1], _DOOR_M[1] + 0.25)
    return [*solids, canopy]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Plaster, or bricks, over a darker plinth; frames, panes that mirror the sky, and a door."""
    wall = pick(
        rng, (grey(rng, 0.6, 0.92), hsv(rng.uniform(0.03, 0.14), rng.uniform(0.15, 0.5), rng.uniform(0.5, 0.9)))
    )
    image = canvas(wall, 192, 256)
    if rng.random() < 0.4:
        for row in np.arange(0.0, 1.0, 0.018):
            rectangle(image, (0.0, row), (1.0, row + 0.004), 0.86 * wall)
    rectangle(image, (0.0, 0.0), (1.0, _v(0.5)), 0.6 * wall)
    frame, pane = grey(rng, 0.75, 0.95), hsv(0.58, rng.uniform(0.1, 0.3), rng.uniform(0.25, 0.5))
    for storey, middle in enumerate(_STOREYS_M):
        for bay, place in enumerate(_BAYS_M):
            if (storey, bay) == (0, 1):
                _opening(image, place, (0.0, _DOOR_M[1]), _DOOR_M[0], hsv(rng.random(), 0.5, 0.35), frame)
            else:
                sides = (middle - _WINDOW_M[1] / 2, middle + _WINDOW_M[1] / 2)
                _opening(image, place, sides, _WINDOW_M[0], pane * rng.uniform(0.7, 1.3), frame)
                rectangle(image, (_u(place - 0.03), _v(sides[0])), (_u(place + 0.03), _v(sides[1])), frame)
    return {"wall": weathered(rng, image, 0.2), "eaves": plain(rng, grey(rng, 0.3, 0.8))}


def _opening(
    image: Image, middle_m: float, heights_m: tuple[float, float], width_m: float, inside: np.ndarray, frame: np.ndarray
) -> None:
    for half, edge, colour in ((width_m / 2 + 0.08, 0.08, frame), (width_m / 2, 0.0, inside)):
        low = (_u(middle_m - half), _v(max(heights_m[0] - edge, 0.0)))
        rectangle(image, low, (_u(middle_m + half), _v(heights_m[1] + edge)), colour)


def _u(place_m: float) -> float:
    return 0.5 + place_m / WIDTH_M


def _v(height_m: float) -> float:
    return height_m / HEIGHT_M


CLASS = AssetClass("facade", None, {"standard": Variant(section.box(DEPTH_M, WIDTH_M), shape, paint)})
