"""Person: standing or striding in trousers, or in a coat over flared ones so wide that a LiDAR sees them."""

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.section import Disc, Section
from mcap_landmarks_generator.assets.shapes import circle, ellipsoid, limb, loft, stack
from mcap_landmarks_generator.assets.solid import Floats, Solid, vector
from mcap_landmarks_generator.assets.texture import (
    Colour,
    Image,
    cloth,
    ellipse,
    grey,
    hsv,
    pick,
    plain,
    polygon,
    stroke,
    vivid,
)

# Height, depth and width (radii) of a body of 1.75 m in a shirt and in a coat.
SHIRT_LEVELS = (
    (0.89, 0.116, 0.17), (0.95, 0.112, 0.165), (1.05, 0.10, 0.15), (1.18, 0.108, 0.16), (1.30, 0.118, 0.18),
    (1.40, 0.105, 0.19), (1.45, 0.08, 0.15), (1.48, 0.062, 0.085), (1.51, 0.05, 0.06),
)  # fmt: skip
COAT_LEVELS = (
    (0.60, 0.165, 0.21), (0.82, 0.140, 0.192), (1.03, 0.112, 0.16), (1.18, 0.112, 0.165),
    (1.30, 0.12, 0.185), (1.40, 0.108, 0.195), (1.45, 0.082, 0.155), (1.49, 0.064, 0.085), (1.53, 0.066, 0.072),
)  # fmt: skip
# Height, middle and radii of a leg of flared trousers, and its way from half a disc (0) to an ellipse (1).
FLARE_LEVELS = (
    (0.105, 0.0, 0.25, 0.25, 0.0), (0.20, 0.0, 0.25, 0.25, 0.0), (0.25, 0.05, 0.19, 0.155, 0.4),
    (0.32, 0.10, 0.135, 0.10, 0.85), (0.46, 0.105, 0.10, 0.09, 1.0),
)  # fmt: skip
SLIT_M = 0.003
"""So far the hems reach into each other."""
SHIN_M = 0.06
COAT_M = 0.25
COAT_HEM_V = 0.17
"""Where the coat's picture, from the middle of its lower end up by length, has its hem."""
# Where the shins stand: (x, y) of the left and of the right one.
STANCES = {"legs": ((0.0, 0.10), (0.0, -0.10)), "stride": ((0.13, 0.08), (-0.13, -0.08))}
ON_LEGS = {name: Section(tuple(Disc(SHIN_M, x, y) for x, y in stance)) for name, stance in STANCES.items()}
SECTIONS = {"coat": section.disc(COAT_M)} | ON_LEGS


def shape(variant: str, rng: np.random.Generator) -> list[Solid]:
    """A person of 1.55 to 1.9 m facing +x."""
    k, broad = rng.uniform(1.55, 1.9) / 1.75, rng.uniform(0.9, 1.15)
    solids = _coat(k, broad) if variant == "coat" else [*_legs(STANCES[variant], k, broad), _torso(k, broad)]
    swing = rng.uniform(-0.35, 0.35) if variant != "stride" else -0.45
    bare = rng.random() < 0.4 and variant != "coat"
    for side in (1, -1):
        bend = rng.choice([rng.uniform(0.1, 0.3), rng.uniform(0.2, 1.3)])
        solids += _arm(side, k, broad, side * swing, rng.uniform(0.06, 0.25), bend, bare)
    return [*solids, *_head(rng, k)]


def _legs(stance: ArrayLike, k: float, broad: float) -> list[Solid]:
    """Trousers from the waist to the shins' places, and shoes."""
    hips = circle(k * broad, 16)
    levels = [(0.80, 0.07, 0.10), (0.86, 0.11, 0.165), (0.96, 0.105, 0.155)]
    solids = [stack([(z * k, hips * (x, y)) for z, x, y in levels], "trousers")]
    for x, y in np.asarray(stance, float):
        side = np.sign(y)
        hip, foot = np.array([0.0, side * 0.085 * k * broad, 0.93 * k]), np.array([x, y, 0.0])
        knee = 0.5 * (hip + foot) + vector(0.025 + 0.04 * (x > 0), 0.0, 0.02)
        calf = 0.4 * knee + 0.6 * (foot + vector(0, 0, 0.25))
        shin = [foot + vector(0, 0, height) for height in (0.23, 0.10, 0.07)]
        spine = [hip, 0.45 * hip + 0.55 * knee, knee, calf, *shin]
        radii = np.array([0.092 * broad, 0.085 * broad, 0.066, 0.064, SHIN_M, SHIN_M, SHIN_M])
        solids += [limb(spine, radii, "trousers", sides=12), _shoe(foot)]
    return solids


def _shoe(foot: Floats) -> Solid:
    """A shoe around the ankle at `foot`."""
    sole = circle(1.0, 12) * (0.14, 0.052) + (0.05, 0)
    upper = circle(1.0, 12) * (0.075, 0.05)
    return stack([(0.0, sole), (0.035, sole), (0.06, 0.6 * sole + 0.4 * upper), (0.10, upper)], "shoes").moved(*foot)


def _torso(k: float, broad: float) -> Solid:
    """A shirt from the hips to the neck."""
    return stack([(z * k, circle(k * broad, 16) * (x, y)) for z, x, y in SHIRT_LEVELS], "top")


def _coat(k: float, broad: float) -> list[Solid]:
    """A coat down to the knees over flared trousers, whose hems meet in a disc of fixed width."""
    levels = [(z * k, circle(k * broad, 16) * (x, y)) for z, x, y in COAT_LEVELS]
    solids = [stack(levels, "coat")]
    for side in (1, -1):
        solids += [_flared_leg(side, k, broad), _shoe(np.array([0.06, side * 0.09, 0.0]))]
    return solids


def _flared_leg(side: int, k: float, broad: float) -> Solid:
    """The left (1) or right (-1) leg of flared trousers: half a disc at its hem, an ellipse from the shin up."""
    outside = circle(1.0, 24)[:13]
    inside = np.column_stack([np.linspace(-0.7, 0.7, 5), np.full(5, -SLIT_M / COAT_M)])
    half = np.concatenate([outside, inside])
    turn = np.concatenate([np.linspace(0, np.pi, 13), np.linspace(np.pi, 2 * np.pi, 7)[1:-1]])
    full = np.column_stack([np.cos(turn), np.sin(turn)])
    rings = []
    for z, y, reach_x, reach_y, share in FLARE_LEVELS:
        outline = (half + share * (full - half)) * (reach_x, reach_y) + (0.0, y)
        rings.append(np.column_stack([outline, np.full(len(outline), z)]))
    hip = 0.085 * k * broad
    rings.append(np.column_stack([full * 0.088 * broad + (0.0, hip), np.full(len(full), 0.72 * k)]))
    left = loft(rings, "trousers")
    return left if side > 0 else left.mirrored()


def _arm(side: int, k: float, broad: float, swing: float, spread: float, bend: float, bare: bool) -> list[Solid]:
    """Sleeve and hand of the left (1) or right (-1) arm; `bare` leaves the forearm's skin visible."""
    shoulder = np.array([0.0, side * 0.175 * broad, 1.41]) * k
    upper = _direction(swing, side * spread)
    lower = _direction(swing + bend, side * spread * 0.5)
    elbow = shoulder + 0.29 * k * upper
    wrist = elbow + 0.25 * k * lower
    sleeve = [shoulder - 0.03 * k * upper, shoulder + 0.02 * k * upper, 0.5 * (shoulder + elbow), elbow]
    sizes = [0.045, 0.062, 0.053, 0.046]
    fist = ellipsoid(0.05 * k, 0.085 * k, 0.12 * k, "skin", sides=8, rings=5).moved(*(wrist + 0.05 * k * lower))
    if bare:
        forearm = [elbow - 0.01 * k * upper, 0.6 * elbow + 0.4 * wrist, wrist]
        return [
            limb(sleeve, np.array(sizes) * k, "top", 8),
            limb(forearm, np.array([0.041, 0.04, 0.028]) * k, "skin", 8),
            fist,
        ]
    return [limb([*sleeve, wrist], np.array([*sizes, 0.036]) * k, "top", 8), fist]


def _direction(swing: float, spread: float) -> Floats:
    """Unit vector of an arm that hangs down, swung forwards and spread sideways."""
    direction = np.array([np.sin(swing), np.sin(spread), -np.cos(swing) * np.cos(spread)])
    return np.asarray(direction / np.linalg.norm(direction))


def _head(rng: np.random.Generator, k: float) -> list[Solid]:
    """Neck, head with nose and eyes, and hair: short, or down to the shoulders."""
    centre = np.array([0.02, 0.0, 1.635]) * k
    head = ellipsoid(0.20 * k, 0.158 * k, 0.245 * k, "skin", sides=14, rings=9).moved(*centre)
    neck = limb([(0, 0, 1.45 * k), (0.012 * k, 0, 1.57 * k)], 0.054 * k, "skin", 8)
    nose = ellipsoid(0.04 * k, 0.03 * k, 0.05 * k, "skin", 5, 4).moved(*(centre + np.array([0.098, 0, -0.012]) * k))
    solids = [head, neck, nose]
    for side in (1, -1):
        eye = ellipsoid(0.016 * k, 0.03 * k, 0.016 * k, "eyes", 5, 4)
        solids.append(eye.moved(*(centre + np.array([0.086, side * 0.033, 0.018]) * k)))
    crown = [(0.0, 1.0), (0.45, 0.93), (0.75, 0.7), (0.95, 0.33)]
    low = rng.uniform(-0.1, 0.15)
    cap = stack([((low + (1 - low) * z) * 0.136 * k, circle(r, 14) * (0.11 * k, 0.09 * k)) for z, r in crown], "hair")
    solids.append(cap.turned((0, 1, 0), -0.4).moved(*(centre + np.array([-0.012, 0, 0.005]) * k)))
    if rng.random() < 0.4:
        solids.append(
            ellipsoid(0.13 * k, 0.19 * k, 0.34 * k, "hair", 12, 7).moved(*(centre - np.array([0.06, 0, 0.05]) * k))
        )
    return solids


def paint(variant: str, rng: np.random.Generator) -> dict[str, Image]:
    """Clothes of everyday colours; a coat is mostly dark or muted."""
    skin = hsv(rng.uniform(0.04, 0.08), rng.uniform(0.25, 0.6), rng.uniform(0.4, 0.97))
    muted = hsv(rng.random(), rng.uniform(0.2, 0.6), rng.uniform(0.2, 0.6))
    denim = hsv(0.61, rng.uniform(0.3, 0.7), rng.uniform(0.2, 0.6))
    top = pick(rng, (vivid(rng, 0.25, 0.8), muted, grey(rng, 0.08, 0.8)))
    trousers = pick(rng, (denim, denim, denim, grey(rng, 0.08, 0.5), grey(rng, 0.08, 0.3), muted))
    navy = hsv(0.61, 0.6, rng.uniform(0.2, 0.45))
    coat = pick(rng, (0.7 * muted, grey(rng, 0.07, 0.35), navy, vivid(rng, 0.25, 0.6)))
    below = pick(rng, (denim, grey(rng, 0.06, 0.2), navy))
    hair = (grey(rng, 0.04, 0.18), hsv(0.07, 0.6, rng.uniform(0.2, 0.4)), hsv(0.12, 0.5, 0.75), grey(rng, 0.5, 0.8))
    return {
        **(_coat_cloths(rng, coat) if variant == "coat" else {"top": cloth(rng, top)}),
        "trousers": plain(rng, below if variant == "coat" else trousers),
        "shoes": plain(rng, pick(rng, (grey(rng, 0.05, 0.3), hsv(0.06, 0.5, 0.3), grey(rng, 0.7, 0.95)))),
        "skin": plain(rng, skin, mottle=0.05),
        "hair": plain(rng, pick(rng, hair), mottle=0.25),
        "eyes": plain(rng, (35, 28, 26)),
    }


def _coat_cloths(rng: np.random.Generator, colour: Colour) -> dict[str, Image]:
    """A coat's sleeves, and the picture around it with its opening in front: lapels over a shirt, and buttons."""
    image, shirt = plain(rng, colour, 128), grey(rng, 0.6, 0.9)
    # The front is where the picture begins and ends.
    for front in (0.0, 1.0):
        polygon(image, [(front, 0.72), (front - 0.07, 0.93), (front + 0.07, 0.93)], shirt)
        for side in (1, -1):
            lapel = [(0.0, 0.70), (0.045, 0.93), (0.10, 0.90), (0.085, 0.82)]
            polygon(image, [(front + side * u, v) for u, v in lapel], 0.8 * colour)
        stroke(image, [(front + 0.012, COAT_HEM_V), (front + 0.012, 0.70)], 0.012, 0.7 * colour)
        for height in (0.45, 0.55, 0.65):
            ellipse(image, (front + 0.03, height), (0.009, 0.009), 0.35 * colour)
    return {"top": plain(rng, colour), "coat": image}


VARIANTS = {name: Variant(SECTIONS[name], partial(shape, name), partial(paint, name)) for name in SECTIONS}
CLASS = AssetClass("person", 0, VARIANTS)
