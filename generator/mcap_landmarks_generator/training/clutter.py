"""Pictures of what is none of the classes: streets of trees and houses, fences, poles, leaves and noise, all painted.

The generator's worlds are emptier than real ones, and a network that has only seen them takes a tree for the nearest
thing with thin parts. These pictures need not pass for real; they have the edges, the fine structure and the spectrum
of real ones (dead leaves: Lee, Mumford and Huang, Occlusion models for natural images, IJCV 2001).
"""

import numpy as np

from mcap_landmarks_generator.assets.texture import Image, to_image
from mcap_landmarks_generator.training import painting
from mcap_landmarks_generator.training.painting import HEIGHT_PX, WIDTH_PX, Canvas, Rng

# Share of pictures that are streets, woods, walls, fallen leaves and mere noise.
_SHARES = (0.42, 0.2, 0.16, 0.14, 0.08)


def paint(seed: int, index: int) -> Image:
    """The picture (480, 640, 3) of an index, in RGB; it depends on nothing else than seed and index."""
    rng = np.random.default_rng([seed, index])
    painter = (_street, _wood, _wall, _leaves, _noise)[rng.choice(len(_SHARES), p=_SHARES)]
    canvas = painter(rng)
    if rng.random() < 0.5:
        painting.dapple(canvas, rng)
    return _developed(canvas, rng)


def _developed(canvas: Canvas, rng: Rng) -> Image:
    """Exposure, contrast and a cast of colour: skies burn out, and what lies in shadow is nearly black."""
    light = canvas.astype(np.float64) / 255
    light = np.clip(light * np.exp(rng.normal(0.15, 0.3)), 0, None) ** rng.uniform(0.65, 1.4)
    return to_image(255 * light * np.exp(rng.normal(0, 0.05, 3)))


def _street(rng: Rng) -> Canvas:
    """A road between rows of houses, trees, hedges, fences and poles, seen along it."""
    horizon = int(rng.uniform(0.35, 0.65) * HEIGHT_PX)
    vanishing = rng.uniform(0.1, 0.9) * WIDTH_PX
    canvas = painting.sky(rng)
    painting.ground(canvas, horizon, rng)
    for side in (-1, 1):
        if rng.random() < 0.7:
            painting.row_of_houses(canvas, (vanishing, horizon), side, rng)
    for depth in np.sort(rng.uniform(0.05, 1.0, rng.integers(6, 26)) ** 1.7):
        side = rng.choice((-1, 1))
        foot = horizon + depth * (HEIGHT_PX - horizon) * rng.uniform(0.5, 1.0)
        across = vanishing + side * rng.uniform(0.15, 0.9) * WIDTH_PX * (0.1 + depth)
        _thing(canvas, (across, foot), depth, rng)
    return canvas


def _thing(canvas: Canvas, foot: tuple[float, float], depth: float, rng: Rng) -> None:
    """One thing beside the road that stands at a place (x, y) in pixels; `depth` of 1 is near."""
    size = (0.08 + depth) * HEIGHT_PX
    kind = rng.random()
    if kind < 0.5:
        painting.tree(canvas, foot, size * rng.uniform(0.5, 1.4), rng)
    elif kind < 0.68:
        painting.hedge(canvas, foot, size * rng.uniform(0.3, 1.5), size * rng.uniform(0.1, 0.4), rng)
    elif kind < 0.88:
        painting.pole(canvas, foot, size * rng.uniform(0.5, 1.5), rng)
    else:
        painting.fence(canvas, foot, size * rng.uniform(0.4, 2.0), size * rng.uniform(0.1, 0.5), rng)


def _wood(rng: Rng) -> Canvas:
    """Trees before trees, down to twigs against the sky."""
    horizon = int(rng.uniform(0.3, 0.9) * HEIGHT_PX)
    canvas = painting.sky(rng)
    painting.ground(canvas, horizon, rng)
    for depth in np.sort(rng.uniform(0.1, 1.0, rng.integers(4, 14))):
        foot = rng.uniform(0, WIDTH_PX), horizon + depth * rng.uniform(0, 1) * (HEIGHT_PX - horizon)
        painting.tree(canvas, foot, depth * rng.uniform(0.4, 1.8) * HEIGHT_PX, rng)
        if rng.random() < 0.5:
            low = rng.uniform(0, WIDTH_PX), horizon + depth * 60
            painting.hedge(canvas, low, rng.uniform(50, 400), depth * rng.uniform(20, 120), rng)
    return canvas


def _wall(rng: Rng) -> Canvas:
    """A wall of a house or of a hall, from the front or slanting, with fences and plants before it."""
    canvas = painting.sky(rng)
    horizon = int(rng.uniform(0.45, 0.95) * HEIGHT_PX)
    painting.ground(canvas, horizon, rng)
    left, right = rng.uniform(-0.5, 0.3) * WIDTH_PX, rng.uniform(0.6, 1.5) * WIDTH_PX
    tops, feet = rng.uniform(-0.4, 0.5, 2) * HEIGHT_PX, horizon + rng.uniform(0, 60, 2)
    corners = np.array([[left, tops[0]], [right, tops[1]], [right, feet[1]], [left, feet[0]]])
    painting.lay(canvas, painting.facade(rng), corners)
    for _ in range(rng.integers(0, 9)):
        foot = rng.uniform(0, WIDTH_PX), min(horizon + rng.uniform(0, 120), HEIGHT_PX)
        _thing(canvas, foot, rng.uniform(0.1, 1.0), rng)
    return canvas


def _leaves(rng: Rng) -> Canvas:
    """Dead leaves: shapes of all sizes that hide each other, each of its own colour and texture."""
    canvas = painting.cloudy(rng)
    palette = painting.palette(rng, 6)
    sizes = np.sort(3.0 * (1 - rng.random(rng.integers(200, 1200)) * 0.9995) ** -0.5)[::-1]
    for size in sizes:
        painting.shape(canvas, rng.uniform(0, (WIDTH_PX, HEIGHT_PX)), min(size, 150.0), palette, rng)
    return canvas


def _noise(rng: Rng) -> Canvas:
    """Two layers of coloured noise, cut along a smooth line."""
    canvas, other = painting.cloudy(rng), painting.cloudy(rng)
    edge = painting.smooth(rng, 2, 30) > rng.uniform(0.3, 0.7)
    canvas[edge] = other[edge]
    return canvas
