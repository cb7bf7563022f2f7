"""Fire hydrant: barrel with flanges and bolts, bonnet with its nut, two hose nozzles and a pumper nozzle in front."""

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import lathe
from mcap_landmarks_generator.assets.solid import Solid
from mcap_landmarks_generator.assets.texture import Image, grey, hsv, pick, plain

BARREL_M = 0.15


def shape(rng: np.random.Generator) -> list[Solid]:
    """A hydrant of 0.75 to 0.9 m; the barrel's radius is fixed."""
    tall = rng.uniform(1.0, 1.15)
    r, shoulder = BARREL_M, 0.56 * tall
    bonnet = rng.uniform(0.9, 1.12)
    solids = [
        lathe([(1.45 * r, 0), (1.45 * r, 0.035), (1.12 * r, 0.04), (r, 0.07)], "body", sides=20),
        lathe([(r, 0.05), (r, 0.22), (0.9 * r, 0.30), (0.88 * r, shoulder)], "body", sides=24),
        lathe([(1.0 * r, 0.28), (1.06 * r, 0.285), (1.06 * r, 0.315), (0.95 * r, 0.32)], "body", sides=20),
        lathe([(1.45 * r, shoulder), (1.45 * r, shoulder + 0.045), (1.25 * r, shoulder + 0.05)], "cap", sides=20),
        lathe(_bonnet(r, shoulder + 0.05, 0.13 * bonnet), "cap", sides=20),
        lathe([(0.30 * r, 0), (0.26 * r, 0.05)], "nut", sides=5).moved(z_m=shoulder + 0.05 + 0.13 * bonnet),
    ]
    for turn in range(8):
        bolt = lathe([(0.018, 0.03), (0.018, 0.06)], "nut", sides=5).moved(1.27 * r)
        solids.append(bolt.turned((0, 0, 1), (turn + 0.5) * np.pi / 4))
        top = lathe([(0.014, -0.012), (0.014, 0.062)], "nut", sides=4).moved(1.34 * r, z_m=shoulder)
        solids.append(top.turned((0, 0, 1), (turn + 0.5) * np.pi / 4))
    height = shoulder - rng.uniform(0.1, 0.13) * tall
    solids += _nozzle(0.058, height, np.pi / 2) + _nozzle(0.058, height, -np.pi / 2) + _nozzle(0.07, height - 0.03, 0)
    return solids


def _bonnet(r: float, base: float, height: float) -> list[tuple[float, float]]:
    """Profile of the dome."""
    turn = np.linspace(0, 1.35, 6)
    return [(1.08 * r * np.cos(t) + 0.02, base + height * np.sin(t) / np.sin(1.35)) for t in turn]


def _nozzle(radius: float, height: float, heading: float) -> list[Solid]:
    """A nozzle with its cap and nut, pointing along `heading`."""
    reach = BARREL_M * 0.8
    pipe = lathe([(radius, 0), (radius, 0.055)], "body", sides=14)
    cap = lathe([(1.28 * radius, 0.05), (1.28 * radius, 0.095), (1.05 * radius, 0.115)], "cap", sides=14)
    nut = lathe([(0.42 * radius, 0.11), (0.38 * radius, 0.155)], "nut", sides=5)
    return [
        solid.moved(z_m=reach).turned((0, 1, 0), np.pi / 2).turned((0, 0, 1), heading).moved(z_m=height)
        for solid in (pipe, cap, nut)
    ]


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """Mostly red or yellow all over; bonnet and caps at times a little darker, or silver."""
    red = hsv(rng.uniform(-0.02, 0.02), rng.uniform(0.8, 1), rng.uniform(0.6, 0.95))
    yellow = hsv(rng.uniform(0.10, 0.14), rng.uniform(0.8, 1), rng.uniform(0.75, 1))
    body = pick(rng, (red, red, red, red, red, yellow, yellow, yellow, yellow, grey(rng, 0.85, 0.97)))
    cap = pick(rng, (body, body, body, 0.85 * body, 0.85 * body, grey(rng, 0.65, 0.95)))
    return {
        "body": plain(rng, body, 64),
        "cap": plain(rng, cap),
        "nut": plain(rng, pick(rng, (0.75 * cap, grey(rng, 0.3, 0.7)))),
    }


CLASS = AssetClass("fire hydrant", 10, {"standard": Variant(section.disc(BARREL_M), shape, paint)})
