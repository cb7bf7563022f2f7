"""Pictures that materials are made of: noise, colours, cloth, wood, all from a seeded random generator."""

import colorsys
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.uint8]
Colour = NDArray[np.float64]


def hsv(hue: float, saturation: float, value: float) -> Colour:
    """An RGB colour (3,) in 0..255 from hue (turns, any), saturation and value (0..1)."""
    return np.array(colorsys.hsv_to_rgb(hue % 1.0, saturation, value)) * 255


def grey(rng: np.random.Generator, low: float, high: float) -> Colour:
    """A nearly neutral colour whose brightness lies between `low` and `high` (0..1)."""
    return np.asarray(np.clip(rng.uniform(low, high) * 255 + rng.normal(0, 3, 3), 0, 255))


def vivid(rng: np.random.Generator, low: float = 0.25, high: float = 1.0) -> Colour:
    """A saturated colour of any hue whose value lies between `low` and `high`."""
    return hsv(rng.random(), rng.uniform(0.5, 1.0), rng.uniform(low, high))


def pick(rng: np.random.Generator, options: Sequence[ArrayLike]) -> Colour:
    """One of several colours."""
    return np.asarray(options[int(rng.integers(len(options)))], np.float64)


def noise(
    rng: np.random.Generator, height_px: int, width_px: int, octaves: int = 4, cells: int = 2
) -> NDArray[np.float64]:
    """Smooth noise (height_px, width_px) in 0..1 that tiles in both directions, from `cells` blobs across upwards."""
    total = np.zeros((height_px, width_px))
    for octave in range(octaves):
        across = cells * 2**octave
        if across > max(height_px, width_px):
            break
        total += _tiling(rng.random((across, across)), height_px, width_px) / 2**octave
    span = np.ptp(total)
    return np.asarray((total - total.min()) / (span if span > 0 else 1.0))


def _tiling(coarse: NDArray[np.float64], height_px: int, width_px: int) -> NDArray[np.float64]:
    """`coarse` enlarged smoothly, its right edge leading over into its left one and its bottom into its top."""
    n = len(coarse)
    padded = np.pad(coarse, 2, mode="wrap").astype(np.float32)
    y, x = np.meshgrid(np.arange(height_px) * n / height_px + 2, np.arange(width_px) * n / width_px + 2, indexing="ij")
    return cv2.remap(padded, x.astype(np.float32), y.astype(np.float32), cv2.INTER_CUBIC).astype(float)


def to_image(values: ArrayLike) -> Image:
    """Values of any range as 8-bit pixels."""
    return np.asarray(np.clip(np.rint(np.asarray(values, float)), 0, 255), np.uint8)


def plain(rng: np.random.Generator, colour: ArrayLike, size_px: int = 32, mottle: float = 0.12) -> Image:
    """One colour, brighter and darker in places by the share `mottle`."""
    shade = 1 + mottle * (2 * noise(rng, size_px, size_px) - 1)
    return to_image(np.asarray(colour, float) * shade[..., None])


def striped(
    rng: np.random.Generator, colours: tuple[ArrayLike, ArrayLike], count: int, size_px: int = 64, upright: bool = False
) -> Image:
    """`count` pairs of stripes in two colours."""
    phase = (np.arange(size_px) * count / size_px) % 1 < 0.5
    mask = np.broadcast_to(phase[None, :] if upright else phase[:, None], (size_px, size_px))
    return _two_tone(rng, mask, colours)


def checked(rng: np.random.Generator, colours: tuple[ArrayLike, ArrayLike], count: int, size_px: int = 64) -> Image:
    """A chequered cloth of `count` fields across."""
    step = np.arange(size_px) * count // size_px
    return _two_tone(rng, (step[:, None] + step[None, :]) % 2 == 0, colours)


def _two_tone(rng: np.random.Generator, mask: NDArray[np.bool_], colours: tuple[ArrayLike, ArrayLike]) -> Image:
    """Two mottled colours chosen by a mask."""
    first, second = (plain(rng, colour, len(mask)) for colour in colours)
    return np.where(mask[..., None], first, second)


def wooden(rng: np.random.Generator, colour: ArrayLike, size_px: int = 64, grain: float = 9.0) -> Image:
    """Wood with its grain along u."""
    rows = np.linspace(0, 1, size_px)[:, None]
    waves = np.sin(2 * np.pi * (grain * rows + 1.2 * noise(rng, size_px, size_px)))
    fine = noise(rng, size_px, size_px, octaves=3, cells=8)
    return to_image(np.asarray(colour, float) * (0.86 + 0.12 * waves + 0.16 * (fine - 0.5))[..., None])


def cloth(rng: np.random.Generator, colour: ArrayLike, size_px: int = 64) -> Image:
    """A shirt or a coat: plain, striped, or chequered."""
    kind = rng.integers(5)
    other = pick(rng, (vivid(rng), grey(rng, 0.1, 0.95)))
    if kind == 0:
        return striped(rng, (colour, other), int(rng.integers(4, 9)), size_px)
    if kind == 1:
        return checked(rng, (colour, other), int(rng.integers(6, 12)), size_px)
    return plain(rng, colour, size_px)


def canvas(colour: ArrayLike, height_px: int, width_px: int) -> Image:
    """A picture of one colour to paint on."""
    return to_image(np.broadcast_to(np.asarray(colour, float), (height_px, width_px, 3)))


def polygon(image: Image, corners_uv: ArrayLike, colour: ArrayLike) -> None:
    """Fill a polygon, its corners (N,2) in texture coordinates (u right, v up, 0..1), with smooth edges."""
    scale = np.array([image.shape[1], image.shape[0]])
    corners = (np.asarray(corners_uv, float) * (1, -1) + (0, 1)) * scale - 0.5
    rgb = [float(c) for c in np.asarray(colour, float)]
    cv2.fillPoly(image, [np.rint(corners * 16).astype(np.int32)], rgb, cv2.LINE_AA, 4)


def stroke(image: Image, points_uv: ArrayLike, width: float, colour: ArrayLike) -> None:
    """Draw a line through points (N,2) in texture coordinates; its width is a share of the picture's."""
    scale = np.array([image.shape[1], image.shape[0]])
    points = (np.asarray(points_uv, float) * (1, -1) + (0, 1)) * scale - 0.5
    rgb = [float(c) for c in np.asarray(colour, float)]
    thickness = max(1, round(width * image.shape[1]))
    cv2.polylines(image, [np.rint(points * 16).astype(np.int32)], False, rgb, thickness, cv2.LINE_AA, 4)


def rectangle(image: Image, low_uv: tuple[float, float], high_uv: tuple[float, float], colour: ArrayLike) -> None:
    """Fill the rectangle between two corners in texture coordinates."""
    (u0, v0), (u1, v1) = low_uv, high_uv
    polygon(image, [(u0, v0), (u1, v0), (u1, v1), (u0, v1)], colour)


def ellipse(image: Image, centre_uv: tuple[float, float], radii_uv: tuple[float, float], colour: ArrayLike) -> None:
    """Fill an ellipse in texture coordinates."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    polygon(
        image, np.asarray(centre_uv) + np.column_stack([np.cos(angle), np.sin(angle)]) * np.asarray(radii_uv), colour
    )


def weathered(rng: np.random.Generator, image: Image, amount: float = 0.12) -> Image:
    """A painted picture, unevenly bright."""
    shade = 1 - amount * noise(rng, *image.shape[:2])
    return to_image(image * shade[..., None])
