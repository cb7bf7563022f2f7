"""Bicycle: diamond frame, two wheels with spokes, saddle, handlebars, chain ring, cranks and pedals."""

import numpy as np

from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.section import Box, Section
from mcap_landmarks_generator.assets.shapes import box, ellipsoid, limb, torus
from mcap_landmarks_generator.assets.solid import Floats, Solid, vector
from mcap_landmarks_generator.assets.texture import Image, grey, pick, plain, vivid

WHEEL_M, BASE_M = 0.34, 1.04
TYRE_M = 0.022
# At LiDAR height a wheel is met twice, where tyre and rim go up; the spokes between are hardly ever hit.
MEETING_M, MEETING_LENGTH_M = 0.262, 0.06


def shape(rng: np.random.Generator) -> list[Solid]:
    """A bicycle that points along +x."""
    rear, front = np.array([-BASE_M / 2, 0, WHEEL_M]), np.array([BASE_M / 2, 0, WHEEL_M])
    crank = np.array([-0.07, 0, 0.29])
    seat = np.array([-0.2, 0, rng.uniform(0.70, 0.82)])
    neck = np.array([BASE_M / 2 - 0.2, 0, rng.uniform(0.78, 0.86)])
    fork = neck + vector(0.04, 0, -0.14)
    slope = np.array([0, 0, rng.choice([0.0, rng.uniform(-0.2, -0.05)])])
    solids = _wheel(rear) + _wheel(front)
    frame = [(crank, seat, 0.019), (seat + slope, neck, 0.018), (crank, fork, 0.022), (fork, neck, 0.022)]
    for low, high, radius in frame:
        solids.append(limb([low, high], radius, "frame", 7))
    for y in (0.055, -0.055):
        side = np.array([0, y, 0])
        stays = [(crank + 0.3 * side, rear + side), (seat + 0.3 * side, rear + side), (fork + 0.7 * side, front + side)]
        solids += [limb(stay, 0.012, "frame", 5) for stay in stays]
    return solids + _saddle(seat) + _handlebars(neck, rng.random() < 0.5) + _cranks(crank)


def _wheel(centre: Floats) -> list[Solid]:
    """Tyre, rim, hub and spokes."""
    solids = [
        torus(WHEEL_M - TYRE_M, TYRE_M, "tyre", 22, 5),
        torus(WHEEL_M - 2 * TYRE_M, 0.010, "metal", 20, 4),
        limb([(0, -0.045, 0), (0, 0.045, 0)], 0.022, "metal", 6),
    ]
    for turn in range(8):
        angle = turn * np.pi / 4 + 0.3
        tip = (WHEEL_M - 2 * TYRE_M) * np.array([np.cos(angle), 0, np.sin(angle)])
        solids.append(limb([vector(0, 0, 0), tip], 0.003, "metal", 3))
    return [solid.moved(*centre) for solid in solids]


def _saddle(seat: Floats) -> list[Solid]:
    """Seat post and saddle."""
    top = seat + vector(-0.03, 0, 0.12)
    return [
        limb([seat, top], 0.014, "metal", 6),
        ellipsoid(0.28, 0.15, 0.07, "rubber", 10, 6).moved(*(top + vector(0, 0, 0.02))),
    ]


def _handlebars(neck: Floats, dropped: bool) -> list[Solid]:
    """A stem and a straight or a dropped bar."""
    top = neck + vector(-0.02, 0, 0.10)
    solids = [
        limb([neck, top], 0.017, "metal", 6),
        limb([top - vector(0, 0.27, 0), top + vector(0, 0.27, 0)], 0.014, "metal", 6),
    ]
    for y in (0.27, -0.27):
        end = top + vector(0, y, 0)
        if dropped:
            bend = [end, end + vector(0.09, 0, -0.01), end + vector(0.10, 0, -0.09), end + vector(0.02, 0, -0.12)]
            solids.append(limb(bend, 0.016, "rubber", 6))
        else:
            solids.append(limb([end - vector(0, 0.4 * y, 0), end + vector(-0.03, 0.15 * y, 0)], 0.02, "rubber", 6))
    return solids


def _cranks(crank: Floats) -> list[Solid]:
    """Chain ring and level cranks with their pedals."""
    solids = [torus(0.085, 0.011, "metal", 14, 4).moved(*(crank + vector(0, -0.05, 0)))]
    for side in (1, -1):
        start = crank + vector(0, side * 0.03, 0)
        end = crank + vector(side * 0.16, side * 0.09, 0)
        solids += [
            limb([start, end], 0.011, "metal", 5),
            box(0.09, 0.09, 0.025, "rubber").moved(*(end + vector(0, side * 0.05, 0))),
        ]
    return solids


def paint(rng: np.random.Generator) -> dict[str, Image]:
    """A coloured frame; everything else black or metal."""
    return {
        "frame": plain(rng, pick(rng, (vivid(rng, 0.4), vivid(rng, 0.4), grey(rng, 0.05, 0.95))), mottle=0.05),
        "tyre": plain(rng, grey(rng, 0.05, 0.15)),
        "rubber": plain(rng, grey(rng, 0.04, 0.2)),
        "metal": plain(rng, grey(rng, 0.35, 0.8)),
    }


PATCHES = tuple(Box(MEETING_LENGTH_M, 2 * TYRE_M, x * BASE_M / 2 + y * MEETING_M) for x in (1, -1) for y in (1, -1))
CLASS = AssetClass("bicycle", 1, {"standard": Variant(Section(PATCHES), shape, paint)})
