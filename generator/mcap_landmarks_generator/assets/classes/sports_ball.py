"""Sports ball: a football, a basketball or a beach ball, painted on a sphere."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe
from mcap_landmarks_generator.assets.solid import Floats, Solid, rotation
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, noise, pick, to_image, vivid

BALL_M = 0.15
# The slice at LiDAR height is hardly smaller than the equator, which lies in the middle of the band.
SECTION_M = 0.148
HEIGHT_PX, WIDTH_PX = 128, 256
# How far a truncated icosahedron's pentagons are from its middle, as a share of its hexagons' distance: 2.327 / 2.267.
PENTAGON_TO_HEXAGON = 1.0265


def shape(rng: np.random.Generator) -> list[Solid]:
    """A sphere that touches the ground, turned so that its texture's poles show too."""
    polar = np.linspace(-np.pi / 2, np.pi / 2, 17)
    # Facets pull the outline in; so that it is right on average the sphere is drawn as much larger.
    radius = BALL_M * 1.003
    ball = lathe(np.column_stack([radius * np.cos(polar), radius * np.sin(polar)]), "ball", sides=24)
    tilt = rng.uniform(0, np.pi)
    return [ball.turned((1, 0, 0), tilt).turned((0, 0, 1), rng.uniform(0, 2 * np.pi)).moved(z_m=BALL_M)]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """One of the three kinds of ball."""
    v, u = np.mgrid[0:HEIGHT_PX, 0:WIDTH_PX]
    polar = np.pi * (0.5 - (v + 0.5) / HEIGHT_PX)
    around = 2 * np.pi * (u + 0.5) / WIDTH_PX
    points = np.stack([np.cos(polar) * np.cos(around), np.cos(polar) * np.sin(around), np.sin(polar)], axis=-1)
    kind = rng.choice(["football", "football", "basketball", "beach ball"])
    painter = {"football": _football, "basketball": _basketball, "beach ball": _beach_ball}[kind]
    image = painter(rng, points)
    return {"ball": to_image(image * (1 - 0.1 * noise(rng, HEIGHT_PX, WIDTH_PX))[..., None])}


def _football(rng: np.random.Generator, points: Floats) -> Floats:
    """A truncated icosahedron: twelve dark pentagons, twenty white hexagons, and the seams between them."""
    golden = (1 + np.sqrt(5)) / 2
    signs = [(a, b) for a in (1, -1) for b in (1, -1)]
    pentagons = [point for a, b in signs for point in _turns((0, a, b * golden))]
    hexagons = [point for a, b in signs for point in _turns((0, a / golden, b * golden))]
    hexagons += [(a, b, c) for a, b in signs for c in (1, -1)]
    # A point belongs to the face whose plane it is farthest out to; hexagons are nearer to the middle.
    planes = np.array([np.array(face) / np.linalg.norm(face) for face in pentagons + hexagons])
    planes[len(pentagons) :] *= PENTAGON_TO_HEXAGON
    out = points @ (planes @ rotation((0.3, 0.5, 0.7), 1.0).T).T
    best = np.sort(out, axis=-1)
    patch = out.argmax(axis=-1) < len(pentagons)
    seam = best[..., -1] - best[..., -2] < 0.018
    dark = pick(rng, (grey(rng, 0.04, 0.12), grey(rng, 0.04, 0.12), vivid(rng, 0.3, 0.8)))
    image = np.where(patch[..., None], dark, 242.0)
    return np.where((seam & ~patch)[..., None], 140.0, image)


def _turns(point: tuple[float, float, float]) -> list[tuple[float, float, float]]:
    """A point and its cyclic permutations."""
    x, y, z = point
    return [(x, y, z), (y, z, x), (z, x, y)]


def _basketball(rng: np.random.Generator, points: Floats) -> Floats:
    """Orange with black lines: two great circles and two arcs."""
    x, y, z = np.moveaxis(points, -1, 0)
    lines = (np.abs(z) < 0.03) | (np.abs(x) < 0.03) | (np.abs(np.abs(y) - 0.62 - 0.12 * z**2) < 0.03)
    orange = hsv(rng.uniform(0.045, 0.075), rng.uniform(0.75, 0.9), rng.uniform(0.7, 0.9))
    return np.where(lines[..., None], 25.0, orange)


def _beach_ball(rng: np.random.Generator, points: Floats) -> Floats:
    """Six panels, white and two colours in turn."""
    colours: Floats = np.array([(244.0, 244.0, 244.0), vivid(rng, 0.6), vivid(rng, 0.6)])
    around = np.arctan2(points[..., 1], points[..., 0])
    return np.asarray(colours[np.floor(around / (np.pi / 3)).astype(int) % 3])


CLASS = AssetClass("sports ball", 32, {"standard": Variant(section.disc(SECTION_M), shape, paint)})
