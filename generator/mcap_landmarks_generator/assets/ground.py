"""Ground textures that tile without a seam."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.texture import Colour, Image, grey, hsv, noise, pick, to_image

SIZE_PX = 256


def texture(kind: str, seed: int) -> Image:
    """A ground texture (256,256,3) of one of `KINDS`; one tile should cover about 2 m."""
    return to_image(_PAINTERS[kind](np.random.default_rng([KINDS.index(kind), seed])))


def _mottled(rng: np.random.Generator, colour: Colour, coarse: float, grain: float) -> NDArray[np.float64]:
    """A colour with uneven brightness: `coarse` in large patches, `grain` from pixel to pixel, both as shares."""
    patches = noise(rng, SIZE_PX, SIZE_PX, octaves=6) - 0.5
    return colour * (1 + coarse * patches + grain * rng.standard_normal((SIZE_PX, SIZE_PX)))[..., None]


def _joints(
    rng: np.random.Generator, image: NDArray[np.float64], rows: int, columns: int, shift: float
) -> NDArray[np.float64]:
    """Stones of uneven brightness with darker joints, every other row shifted by a share of a stone."""
    v, u = np.mgrid[0:SIZE_PX, 0:SIZE_PX] / SIZE_PX
    row = np.floor(v * rows).astype(int)
    along = u * columns + shift * (row % 2)
    stone = rng.uniform(0.85, 1.1, (rows, columns))[row, np.floor(along).astype(int) % columns]
    width = rng.uniform(0.03, 0.08)
    joint = ((v * rows) % 1 < width) | (along % 1 < width * columns / rows)
    return image * np.where(joint, rng.uniform(0.5, 0.8), stone)[..., None]


def _grass(rng: np.random.Generator) -> NDArray[np.float64]:
    colour = hsv(rng.uniform(0.2, 0.33), rng.uniform(0.35, 0.7), rng.uniform(0.3, 0.6))
    dry = hsv(0.13, 0.4, 0.6)
    patches = noise(rng, SIZE_PX, SIZE_PX, octaves=5)[..., None] * rng.uniform(0, 0.5)
    return _mottled(rng, np.ones(3), 0.5, 0.12) * (colour * (1 - patches) + dry * patches)


def _asphalt(rng: np.random.Generator) -> NDArray[np.float64]:
    return _mottled(rng, grey(rng, 0.2, 0.5), 0.25, 0.08)


def _concrete(rng: np.random.Generator) -> NDArray[np.float64]:
    image = _mottled(rng, grey(rng, 0.45, 0.8), 0.2, 0.04)
    return _joints(rng, image, 1, 1, 0.0) if rng.random() < 0.5 else image


def _gravel(rng: np.random.Generator) -> NDArray[np.float64]:
    stones = noise(rng, SIZE_PX, SIZE_PX, octaves=3, cells=32) - 0.5
    return _mottled(rng, hsv(0.09, rng.uniform(0, 0.3), rng.uniform(0.4, 0.7)), 0.2, 0.05) * (
        1 + 0.5 * stones[..., None]
    )


def _soil(rng: np.random.Generator) -> NDArray[np.float64]:
    return _mottled(rng, hsv(rng.uniform(0.06, 0.11), rng.uniform(0.25, 0.55), rng.uniform(0.3, 0.65)), 0.5, 0.06)


def _tiles(rng: np.random.Generator) -> NDArray[np.float64]:
    count = int(rng.integers(2, 6))
    colour = pick(rng, (grey(rng, 0.4, 0.9), hsv(rng.uniform(0.05, 0.12), 0.3, rng.uniform(0.5, 0.85))))
    return _joints(rng, _mottled(rng, colour, 0.15, 0.02), count, count, 0.0)


def _chequered(rng: np.random.Generator) -> NDArray[np.float64]:
    count = 2 * int(rng.integers(1, 4))
    step = np.arange(SIZE_PX) * count // SIZE_PX
    dark = (step[:, None] + step[None, :])[..., None] % 2 == 0
    first, second = hsv(rng.random(), rng.uniform(0, 0.5), rng.uniform(0.2, 0.5)), grey(rng, 0.6, 0.95)
    return _mottled(rng, np.ones(3), 0.15, 0.02) * np.where(dark, first, second)


def _brick(rng: np.random.Generator) -> NDArray[np.float64]:
    colour = hsv(rng.uniform(0.0, 0.06), rng.uniform(0.3, 0.6), rng.uniform(0.45, 0.75))
    return _joints(rng, _mottled(rng, colour, 0.2, 0.04), 12, 6, 0.5)


def _planks(rng: np.random.Generator) -> NDArray[np.float64]:
    colour = hsv(rng.uniform(0.06, 0.11), rng.uniform(0.3, 0.6), rng.uniform(0.4, 0.75))
    rows = np.arange(SIZE_PX)[:, None] / SIZE_PX
    grain = np.sin(2 * np.pi * (32 * rows + 1.5 * noise(rng, SIZE_PX, SIZE_PX)))
    return _joints(
        rng, _mottled(rng, colour, 0.15, 0.02) * (1 + 0.06 * grain[..., None]), int(rng.integers(6, 13)), 1, 0.37
    )


_PAINTERS: dict[str, Callable[[np.random.Generator], NDArray[np.float64]]] = {
    "grass": _grass,
    "asphalt": _asphalt,
    "concrete": _concrete,
    "gravel": _gravel,
    "soil": _soil,
    "tiles": _tiles,
    "chequered": _chequered,
    "brick": _brick,
    "planks": _planks,
}
KINDS: tuple[str, ...] = tuple(_PAINTERS)
