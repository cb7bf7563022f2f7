"""Skies with clouds and skylines, as panoramas over the full turn, and their look-up by viewing direction."""

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.texture import Colour, Image, grey, hsv, noise, pick, to_image

Floats = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX = 2048, 384
LOW_RAD, HIGH_RAD = np.deg2rad(-12.0), np.deg2rad(54.0)
KINDS = ("open", "hills", "trees", "town")
# The error of straight lines between the points of the grid, at 530 pixels of focal length, is below 0.01 of the
# panorama's pixels.
_STEP = 8
# Row of the panorama that shows the horizon.
HORIZON_PX = round(HEIGHT_PX * HIGH_RAD / (HIGH_RAD - LOW_RAD))


def panorama(kind: str, seed: int) -> Image:
    """A sky (384,2048,3) with one of `KINDS` along its horizon; columns turn left from azimuth 0, rows go down."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    zenith, horizon = _colours(rng)
    image = _clouded(rng, zenith, horizon)
    if kind == "hills":
        for haze in (0.6, 0.25):
            _ridge(rng, image, hsv(rng.uniform(0.2, 0.6), 0.3, rng.uniform(0.2, 0.5)), horizon, haze, rough=False)
    elif kind == "trees":
        _ridge(rng, image, hsv(rng.uniform(0.2, 0.5), 0.3, 0.4), horizon, 0.5, rough=False)
        _ridge(rng, image, hsv(rng.uniform(0.2, 0.36), 0.5, rng.uniform(0.15, 0.4)), horizon, 0.1, rough=True)
    elif kind == "town":
        for haze in (0.55, 0.2):
            _town(rng, image, horizon, haze)
    return to_image(image)


class Panorama:
    """A panorama, looked up along the rays of a camera's pixels; beyond its upper and lower edge the edge goes on."""

    def __init__(self, image: Image) -> None:
        # So that no camera sees an end of it, half a turn more on either side.
        half = WIDTH_PX // 2
        self._image = np.ascontiguousarray(np.pad(image, ((0, 0), (half, half + 1), (0, 0)), mode="wrap"))

    def view(self, world_from_optical: Floats, u: Floats, v: Floats) -> Image:
        """What a camera with a rotation (3,3) sees in columns and rows with tangents `u` (W,) and `v` (H,)."""
        turn = np.asarray(world_from_optical, np.float64)
        facing = np.arctan2(turn[1, 2], turn[0, 2])
        c, s = np.cos(facing), np.sin(facing)
        ahead = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ turn
        # The angles change so little from pixel to pixel that a coarse grid and straight lines in between are enough.
        x, y, z = (axis[0] * _grid(u)[None, :] + axis[1] * _grid(v)[:, None] + axis[2] for axis in ahead)
        azimuth = facing % (2 * np.pi) + np.arctan2(y, x)
        elevation = np.arctan2(z, np.hypot(x, y))
        column = azimuth * (WIDTH_PX / (2 * np.pi)) + WIDTH_PX // 2
        row = (HIGH_RAD - elevation) * (HEIGHT_PX / (HIGH_RAD - LOW_RAD))
        column_map, row_map = (_filled(coarse, (len(v), len(u))) for coarse in (column, row))
        seen = cv2.remap(self._image, column_map, row_map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(seen, np.uint8)


def _grid(values: Floats) -> Floats:
    """Evenly spaced values (N,) at every `_STEP`-th place, in the middle of so many, from before the first on."""
    step = values[1] - values[0] if len(values) > 1 else 0.0
    places = _STEP * np.arange(-1, len(values) // _STEP + 2) + (_STEP - 1) / 2
    return np.asarray(values[0] + places * step)


def _filled(coarse: Floats, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Values (H,W) of every pixel from those on two `_grid`s."""
    size = (coarse.shape[1] * _STEP, coarse.shape[0] * _STEP)
    fine = cv2.resize(coarse.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine[_STEP : _STEP + shape[0], _STEP : _STEP + shape[1]], np.float32)


def _colours(rng: np.random.Generator) -> tuple[Colour, Colour]:
    """Colours overhead and at the horizon: mostly blue, else overcast or dusk."""
    kind = rng.random()
    if kind < 0.65:
        zenith = hsv(rng.uniform(0.56, 0.62), rng.uniform(0.4, 0.75), rng.uniform(0.6, 0.95))
        return zenith, zenith + (255 - zenith) * rng.uniform(0.4, 0.85)
    if kind < 0.9:
        return grey(rng, 0.5, 0.8), grey(rng, 0.75, 0.98)
    return hsv(rng.uniform(0.55, 0.75), 0.4, rng.uniform(0.35, 0.7)), hsv(rng.uniform(0.02, 0.12), 0.4, 0.95)


def _clouded(rng: np.random.Generator, zenith: Colour, horizon: Colour) -> NDArray[np.float64]:
    """The sky (H,W,3) with a layer of clouds that closes up towards the horizon."""
    elevation = np.linspace(HIGH_RAD, LOW_RAD, HEIGHT_PX)
    height = np.clip(elevation / HIGH_RAD, 0, 1)[:, None, None] ** 0.6
    image = horizon + (zenith - horizon) * np.broadcast_to(height, (HEIGHT_PX, WIDTH_PX, 1))
    azimuth = np.linspace(0, 2 * np.pi, WIDTH_PX, endpoint=False)
    reach = 90.0 / np.maximum(np.tan(np.maximum(elevation, 0.0)), 0.1)
    layer = noise(rng, 512, 512, octaves=6, cells=3).astype(np.float32)
    x, y = (np.mod(reach[:, None] * f(azimuth)[None, :], 511).astype(np.float32) for f in (np.cos, np.sin))
    cover = cv2.remap(layer, x, y, cv2.INTER_LINEAR)
    density = np.clip((cover - rng.uniform(0.35, 0.9)) * 3.5, 0, 1)[..., None] * rng.uniform(0.4, 0.95)
    bright = grey(rng, 0.85, 1.0) * (1 - 0.2 * np.clip(cover - 0.6, 0, 1))[..., None]
    fade = np.clip(np.rad2deg(elevation) / 8.0 - 0.75, 0, 1)[:, None, None]
    return np.asarray(image + (bright - image) * density * fade)


def _ridge(
    rng: np.random.Generator, image: NDArray[np.float64], colour: Colour, horizon: Colour, haze: float, rough: bool
) -> None:
    """Hills, or the edge of a wood, in front of the sky."""
    degree_px = HEIGHT_PX / np.rad2deg(HIGH_RAD - LOW_RAD)
    profile = noise(rng, 1, WIDTH_PX, octaves=8 if rough else 5, cells=24 if rough else 8)[0]
    top = HORIZON_PX - degree_px * (rng.uniform(0.3, 1.5) + rng.uniform(2, 9) * profile)
    rows = np.arange(HEIGHT_PX)[:, None]
    texture = np.tile(noise(rng, HEIGHT_PX, 512, octaves=4, cells=32 if rough else 8), WIDTH_PX // 512)
    filled = colour * (0.75 + 0.5 * texture[..., None])
    cover = np.clip(rows - top[None, :] + 0.5, 0, 1)[..., None]
    image += (filled + (horizon - filled) * haze - image) * cover


def _town(rng: np.random.Generator, image: NDArray[np.float64], horizon: Colour, haze: float) -> None:
    """A row of houses with windows in front of the sky."""
    column = 0
    while column < WIDTH_PX:
        width = int(rng.integers(40, 180))
        top = HORIZON_PX - int(rng.uniform(12, 110))
        wall = pick(
            rng, (grey(rng, 0.3, 0.8), hsv(rng.uniform(0, 0.12), rng.uniform(0.15, 0.5), rng.uniform(0.35, 0.8)))
        )
        house = np.broadcast_to(wall, (HEIGHT_PX - top, width, 3)).copy()
        storey, bay = int(rng.integers(9, 18)), int(rng.integers(9, 20))
        window = pick(rng, (wall * 0.45, hsv(0.57, 0.3, 0.5), grey(rng, 0.1, 0.3)))
        row, offset = np.mgrid[0 : HEIGHT_PX - top, 0:width]
        house[(row % storey > storey * 0.45) & (offset % bay > bay * 0.45) & (row > 3)] = window
        target = image[top:, column : column + width]
        target[:] = (house + (horizon - house) * haze)[:, : target.shape[1]]
        column += width + (int(rng.integers(0, 120)) if rng.random() < 0.35 else 0)
