"""Car: a saloon, a hatchback or an estate, its body a loft with painted windows, doors and wheel arches."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from mcap_landmarks_generator.assets import section
from mcap_landmarks_generator.assets.asset import AssetClass, Variant
from mcap_landmarks_generator.assets.shapes import box, lathe, loft
from mcap_landmarks_generator.assets.solid import Floats, Solid
from mcap_landmarks_generator.assets.texture import (
    Image,
    canvas,
    ellipse,
    grey,
    hsv,
    pick,
    plain,
    polygon,
    rectangle,
    stroke,
    to_image,
    weathered,
)

LENGTH_M, WIDTH_M, CORNER_M = 4.2, 1.74, 0.30
FLOOR_M, ROOF_M = 0.10, 1.42
WHEEL_M, AXLES_M = 0.32, (1.32, -1.30)
# u of a ring's corners, from below up to the roof's ridge; the waist (5) and the roof's edge (7) bound the windows.
CORNERS_U = np.array([0.0, 0.03, 0.06, 0.15, 0.22, 0.26, 0.345, 0.43, 0.47, 0.5])
WAIST_U, ROOF_U = CORNERS_U[5], CORNERS_U[7]
# Heights of the corners 1 to 5 where the body is highest, to paint by.
SIDE_M = (FLOOR_M, 0.22, 0.55, 0.82, 0.90)
GLASS, DARK, HEADLIGHT, TAIL_LIGHT = (24, 30, 34), (18, 18, 20), (238, 240, 236), (190, 20, 22)
LAMP_HOUSING = (52, 55, 60)
SKY = np.array([165.0, 185.0, 200.0])


@dataclass(frozen=True, slots=True)
class Outline:
    """Side view: x of the windscreen's foot and top, of the rear window's top and foot, and the tail's height."""

    screen_foot_m: float
    screen_top_m: float
    rear_top_m: float
    rear_foot_m: float
    tail_m: float


OUTLINES = {
    "saloon": Outline(1.05, 0.15, -1.00, -1.62, 0.99),
    "hatchback": Outline(1.05, 0.15, -1.45, -1.98, 0.93),
    "estate": Outline(1.05, 0.20, -1.80, -2.05, 0.91),
}


def shape(outline: Outline, rng: np.random.Generator) -> list[Solid]:
    """A car that points along +x."""
    solids = [_body(outline, rng.uniform(-0.03, 0.05))]
    end = LENGTH_M / 2
    solids.append(_panel("front", 1.14, 0.42, 0.45).moved(end))
    solids.append(_panel("rear", 1.14, 0.50, 0.48).turned((0, 0, 1), np.pi).moved(-end))
    for x in AXLES_M:
        wheel = _wheel().moved(x, WIDTH_M / 2 - 0.097, WHEEL_M)
        solids += [wheel, wheel.mirrored()]
    mirror = box(0.12, 0.16, 0.11, "paint").moved(0.72, WIDTH_M / 2 + 0.02, 0.98)
    return [*solids, mirror, mirror.mirrored()]


def _body(outline: Outline, lift: float) -> Solid:
    """The body: rings across the car, from the tail to the nose."""
    end = LENGTH_M / 2
    turn = np.linspace(0, np.pi / 2, 6)
    rounded_x, inset = end - CORNER_M * (1 - np.sin(turn)), CORNER_M * (1 - np.cos(turn))
    foot, top, rear_top, rear_foot = (
        outline.screen_foot_m,
        outline.screen_top_m,
        outline.rear_top_m,
        outline.rear_foot_m,
    )
    roof_x = [rear_top, rear_top + 0.15, 0.5 * (rear_top + top), top - 0.15, top]
    roof_z = np.array([ROOF_M - 0.05, ROOF_M - 0.01, ROOF_M + 0.03, ROOF_M + 0.01, ROOF_M - 0.03]) + lift
    top_x = [-end, -end + 0.05, rear_foot, *roof_x, foot, 1.6, 1.9, end - 0.08, end]
    top_z = [0.78, outline.tail_m - 0.04, outline.tail_m, *roof_z, 0.97, 0.90, 0.83, 0.74, 0.62]
    stations = np.unique(np.concatenate([-rounded_x, rounded_x, top_x]))
    ridge = np.interp(stations, top_x, top_z)
    half = WIDTH_M / 2 - np.interp(np.abs(stations), rounded_x, inset)
    waist = np.minimum(np.interp(stations, [-end, -1.9, foot, 1.9, end], [0.72, 0.93, 0.90, 0.77, 0.57]), ridge - 0.04)
    roof = half * np.interp(stations, [rear_foot, rear_top, top, foot], [0.86, 0.66, 0.66, 0.86])
    rings = [_ring(*values) for values in zip(stations, half, waist, roof, ridge, strict=True)]
    around = np.concatenate([CORNERS_U, 1 - CORNERS_U[::-1][1:]])
    return loft(rings, "body", around, stations / LENGTH_M + 0.5)


def _ring(x: float, half: float, waist: float, roof: float, ridge: float) -> list[tuple[float, float, float]]:
    """The body's cut at x: corners as in `CORNERS_U`, then the right side upside down."""
    edge = max(ridge - 0.07, waist)
    left = [
        (half, FLOOR_M), (half, 0.22), (half, 0.6 * waist), (half, waist - 0.06), (half - 0.03, waist),
        (0.5 * (half + roof) + 0.01, 0.5 * (waist + edge)), (roof, edge), (0.65 * roof, ridge - 0.015),
    ]  # fmt: skip
    return [(x, 0.0, FLOOR_M), *[(x, y, z) for y, z in left], (x, 0.0, ridge), *[(x, -y, z) for y, z in left[::-1]]]


def _panel(material: str, width: float, height: float, middle: float) -> Solid:
    """A painted plate, hardly thicker than paint, that shows the lights."""
    return box(0.006, width, height, material).moved(z_m=middle)


def _wheel() -> Solid:
    """The left front wheel about its centre: its texture is projected from outside."""
    tyre = [(WHEEL_M, 0.0), (WHEEL_M, 0.08), (WHEEL_M - 0.03, 0.10), (0.6 * WHEEL_M, 0.10), (0, 0.085)]
    wheel = lathe(tyre, "wheel", 20).turned((1, 0, 0), -np.pi / 2)
    uv = 0.5 + wheel.vertices[:, [0, 2]] / (2 * WHEEL_M)
    return Solid(wheel.vertices, uv, wheel.faces, "wheel")


def paint(outline: Outline, rng: np.random.Generator) -> dict[str, Image]:
    """Car colours as they are on the road: white, silver, black, and some blue, red and others."""
    strong = hsv(rng.choice([0.6, 0.6, 0.0, 0.0, rng.random()]), rng.uniform(0.6, 0.9), rng.uniform(0.25, 0.7))
    colour = pick(rng, (grey(rng, 0.8, 0.97), grey(rng, 0.45, 0.7), grey(rng, 0.45, 0.7), grey(rng, 0.08, 0.2), strong))
    return {
        "body": weathered(rng, _glossed(_painted_body(outline, colour)), 0.04),
        "front": _front(colour),
        "rear": _rear(colour),
        "wheel": _painted_wheel(grey(rng, 0.5, 0.8)),
        "paint": plain(rng, 0.9 * colour),
    }


def _glossed(image: Image) -> Image:
    """What polish and glass mirror: less light low on the sides, sky on the shoulders, the roof and the panes."""
    u = (np.arange(256) + 0.5) / 256
    u = np.minimum(u, 1 - u)
    light = np.interp(u, [0.0, 0.14, 0.20, WAIST_U], [0.5, 0.62, 0.85, 1.0])[None, :, None]
    shine = np.interp(u, [0.23, 0.25, 0.265, 0.28, 0.43, 0.44], [0.0, 0.3, 0.3, 0.0, 0.0, 0.22])[None, :, None]
    glass = np.all(np.abs(image.astype(float) - GLASS) < 8, axis=2)[..., None]
    mirrored = np.interp(u, [WAIST_U, 0.36, ROOF_U, 0.5], [0.0, 0.12, 0.4, 0.25])[None, :, None]
    return to_image(np.where(glass, image * (1 - mirrored) + SKY * mirrored, image * light * (1 - shine) + 255 * shine))


def _painted_body(outline: Outline, colour: Floats) -> Image:
    """Windows, doors, arches, dark sills and the lights' outer ends, in the loft's own coordinates."""
    right = canvas(colour, 256, 256)
    foot, top, rear_top, rear_foot = (
        outline.screen_foot_m,
        outline.screen_top_m,
        outline.rear_top_m,
        outline.rear_foot_m,
    )
    seam = 0.5 * colour
    post = 0.5 * (top + rear_top) + 0.12
    rectangle(right, (0.0, 0.0), (_u(0.23), 1.0), DARK)
    for x in AXLES_M:
        ellipse(right, (_u(0.32), _v(x)), (0.095, 0.37 / LENGTH_M), DARK)
    for x in (foot - 0.1, post, max(rear_top, -0.98)):
        rectangle(right, (_u(0.26), _v(x - 0.01)), (_u(0.88), _v(x + 0.01)), seam)
    for x in (post + 0.12, max(rear_top, -0.98) + 0.12):
        rectangle(right, (_u(0.78), _v(x)), (_u(0.82), _v(x + 0.16)), 0.5 * colour)
    low, high = WAIST_U + 0.012, ROOF_U - 0.02
    rear_low = rear_foot + 0.3 * (rear_top - rear_foot)
    for corners in (
        [(low, foot - 0.2), (high, top - 0.02), (high, post + 0.04), (low, post + 0.04)],
        [(low, post - 0.04), (high, post - 0.04), (high, rear_top + 0.06), (low, rear_low + 0.06)],
        [(ROOF_U + 0.012, foot - 0.05), (0.5, foot - 0.05), (0.5, top + 0.03), (ROOF_U + 0.012, top + 0.03)],
        [
            (ROOF_U + 0.014, rear_foot + 0.03),
            (0.5, rear_foot + 0.03),
            (0.5, rear_top - 0.03),
            (ROOF_U + 0.014, rear_top - 0.03),
        ],
    ):
        polygon(right, [(u, _v(x)) for u, x in corners], GLASS)
    lamp = np.array([(_u(0.60), _v(1.84)), (_u(0.60), 1.0), (_u(0.80), 1.0), (_u(0.72), _v(1.82))])
    polygon(right, lamp, LAMP_HOUSING)
    polygon(right, lamp.mean(axis=0) + 0.6 * (lamp - lamp.mean(axis=0)), HEADLIGHT)
    rectangle(right, (_u(0.70), 0.0), (_u(0.90), _v(-1.92)), TAIL_LIGHT)
    return np.concatenate([right[:, :128], right[:, 127::-1]], axis=1)


def _u(height_m: float) -> float:
    """u on the body's side at a height."""
    return float(np.interp(height_m, SIDE_M, CORNERS_U[1:6]))


def _v(x_m: float) -> float:
    """v on the body at a place along the car."""
    return x_m / LENGTH_M + 0.5


def _front(colour: Floats) -> Image:
    """Headlights in dark housings, a barred grille with a badge, a number plate, an air intake and fog lamps."""
    image = canvas(0.85 * colour, 64, 128)
    rectangle(image, (0.0, 0.0), (1.0, 0.14), DARK)
    grille = [(0.27, 0.56), (0.73, 0.56), (0.77, 0.82), (0.23, 0.82)]
    polygon(image, grille, DARK)
    for bar in (0.62, 0.69, 0.76):
        rectangle(image, (0.28, bar - 0.01), (0.72, bar + 0.01), (105, 108, 112))
    ellipse(image, (0.5, 0.69), (0.035, 0.07), (200, 203, 206))
    polygon(image, [(0.14, 0.14), (0.86, 0.14), (0.78, 0.34), (0.22, 0.34)], DARK)
    rectangle(image, (0.38, 0.36), (0.62, 0.50), (235, 235, 225))
    for flip in (False, True):
        corners = np.array([(0.0, 0.56), (0.17, 0.56), (0.21, 0.72), (0.0, 0.84)])
        polygon(image, np.abs(corners - (float(flip), 0.0)), LAMP_HOUSING)
        ellipse(image, (abs(0.09 - float(flip)), 0.67), (0.05, 0.09), HEADLIGHT)
        ellipse(image, (abs(0.10 - float(flip)), 0.26), (0.03, 0.06), (150, 152, 150))
    return image


def _rear(colour: Floats) -> Image:
    """Tail lights, number plate and a dark lower edge."""
    image = canvas(0.85 * colour, 64, 128)
    rectangle(image, (0.0, 0.0), (1.0, 0.14), DARK)
    rectangle(image, (0.36, 0.46), (0.64, 0.60), (235, 235, 225))
    rectangle(image, (0.0, 0.34), (1.0, 0.355), 0.5 * colour)
    for left in (0.0, 0.82):
        rectangle(image, (left, 0.60), (left + 0.18, 0.84), TAIL_LIGHT)
    return image


def _painted_wheel(metal: Floats) -> Image:
    """A tyre around a rim with five spokes."""
    image = canvas((20, 20, 21), 64, 64)
    ellipse(image, (0.5, 0.5), (0.33, 0.33), metal)
    ellipse(image, (0.5, 0.5), (0.28, 0.28), (40, 40, 42))
    for turn in range(5):
        angle = 2 * np.pi * turn / 5
        stroke(image, [(0.5, 0.5), (0.5 + 0.29 * np.cos(angle), 0.5 + 0.29 * np.sin(angle))], 0.09, metal)
    ellipse(image, (0.5, 0.5), (0.05, 0.05), 0.6 * metal)
    return image


SECTION = section.box(LENGTH_M, WIDTH_M, CORNER_M)
VARIANTS = {name: Variant(SECTION, partial(shape, line), partial(paint, line)) for name, line in OUTLINES.items()}
CLASS = AssetClass("car", 2, VARIANTS)
