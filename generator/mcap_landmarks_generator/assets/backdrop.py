"""What a camera sees where no object is: the sky, and the ground with the shadows that lie on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks_generator.assets import sky
from mcap_landmarks_generator.assets.shadow import GroundView, Shadow, darken
from mcap_landmarks_generator.assets.texture import Image, to_image

Floats = NDArray[np.floating]

_LOWEST_RAY = np.float32(-1e-5)
"""Rays flatter than this meet no ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Pinhole:
    """A pinhole camera with square pixels: `u` (W,) and `v` (H,) are the tangents of the angles, to the right and
    down, of its columns and rows."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]

    @classmethod
    def of(cls, width_px: int, height_px: int, focal_px: float) -> "Pinhole":
        """The camera whose axis goes through the middle of the image."""
        across, down = np.arange(width_px) + 0.5 - width_px / 2, np.arange(height_px) + 0.5 - height_px / 2
        return cls(np.asarray(across / focal_px), np.asarray(down / focal_px))

    @property
    def pixel(self) -> float:
        """How far the middles of neighbouring pixels are apart."""
        return float(self.u[1] - self.u[0])


class Backdrop:
    """A sky above an endless ground at z = 0, for one camera.

    The ground is looked up in a pyramid of its texture, as fine as a pixel's footprint there: it does not flicker as
    a renderer's ground of triangles does.
    """

    def __init__(self, camera: Pinhole, panorama: Image, ground: Image, tile_m: float = 2.0) -> None:
        """`ground` (S,S,3), S a power of two, covers `tile_m` squared and repeats."""
        self._camera = camera
        self._panorama = sky.Panorama(panorama)
        self._tile_m = tile_m
        self._texel_m = tile_m / len(ground)
        self._pyramid, self._sizes, self._lefts = _pyramid(ground)
        # Of the squared length of a ray whose depth is 1.
        self._length_2 = (1 + camera.u[None, :] ** 2 + camera.v[:, None] ** 2).astype(np.float32)

    def view(
        self, eye_m: ArrayLike, world_from_optical: ArrayLike, shadows: Sequence[Shadow] = (), shade: float = 0.5
    ) -> Image:
        """The image (H,W,3) from `eye_m` (3,) with a rotation (3,3) of the camera.

        `shade` is the share of light that a shadow takes.
        """
        camera, turn = self._camera, np.asarray(world_from_optical, np.float64)
        image = np.empty((len(camera.v), len(camera.u), 3), np.uint8)
        # The part of a ray's slope that its row gives, and the part that its column gives.
        rows, columns = turn[2, 1] * camera.v + turn[2, 2], turn[2, 0] * camera.u
        above = _span(rows + columns.max() >= _LOWEST_RAY)
        below = _span(rows + columns.min() < _LOWEST_RAY)
        if above is not None:
            image[above] = self._panorama.view(turn, camera.u, camera.v[above])
        if below is not None:
            ground = self._ground(np.asarray(eye_m, np.float64), turn, below, shadows, shade)
            both = slice(below.start, above.stop if above is not None else below.start)
            mixed = both.stop - both.start
            downwards = np.add.outer(rows[both], columns) < _LOWEST_RAY
            np.copyto(image[both], ground[:mixed], where=downwards[..., None])
            image[both.stop : below.stop] = ground[mixed:]
        return image

    def _ground(self, eye: Floats, turn: Floats, rows: slice, shadows: Sequence[Shadow], shade: float) -> Image:
        """The ground (h,W,3) in some rows of the image; where a ray meets it nowhere, anything."""
        u, v = self._camera.u, self._camera.v[rows]
        along = turn[:, 1:2] * v + turn[:, 2:]
        x, y, down = (
            np.add.outer(row.astype(np.float32), column.astype(np.float32))
            for row, column in zip(along, turn[:, :1] * u, strict=True)
        )
        depth = np.float32(-eye[2]) / np.minimum(down, _LOWEST_RAY, out=down)
        # Counted from a corner of the tile below the eye: single precision is enough anywhere in the world.
        corner = np.floor(eye[:2] / self._tile_m) * self._tile_m
        start_x, start_y = (eye[:2] - corner).astype(np.float32)
        x, y = x * depth + start_x, y * depth + start_y
        level = self._level(eye[2], depth, self._length_2[rows])
        colours = self._coloured(x, y, level)
        if shadows:
            places = [Shadow(shadow.darkness, shadow.low_xy - corner) for shadow in shadows]
            darken(colours, GroundView(x, y, rows.start, self._pixel_from_ground(eye, turn, corner)), places, shade)
        return colours

    def _level(
        self, height: float, depth: NDArray[np.float32], length_2: NDArray[np.float32]
    ) -> NDArray[np.signedinteger]:
        """The level of the pyramid (h,W) whose texels are as large as the pixels' footprints on the ground."""
        # A pixel covers a far patch that is long along the ray; the geometric mean of its sides is a fair compromise:
        # p d sqrt(d / h) with the pixel p, the distance d and the height h, here squared.
        distance_2 = depth * depth
        distance_2 *= length_2
        footprint_2 = distance_2 * np.sqrt(distance_2)
        footprint_2 *= np.float32(2 * (self._camera.pixel / self._texel_m) ** 2 / height)
        # The exponent of twice the square, halved, is the logarithm rounded to the nearest.
        _, exponent = np.frexp(footprint_2)
        exponent -= 1
        exponent >>= 1
        return np.asarray(np.clip(exponent, 0, len(self._sizes) - 1))

    def _coloured(self, x_m: NDArray[np.float32], y_m: NDArray[np.float32], level: NDArray[np.signedinteger]) -> Image:
        """Colours (h,W,3) of the ground at points x and y (h,W), each in its level of the pyramid, bilinear."""
        size = self._sizes[level]
        across, down = x_m * np.float32(1 / self._tile_m), y_m * np.float32(-1 / self._tile_m)
        # Half a texel to the middle of the first, after the one that is repeated before it.
        column = (across - np.floor(across)) * size + self._lefts[level]
        row = (down - np.floor(down)) * size + np.float32(0.5)
        return np.asarray(cv2.remap(self._pyramid, column, row, cv2.INTER_LINEAR), np.uint8)

    def _pixel_from_ground(self, eye: Floats, turn: Floats, corner: Floats) -> Floats:
        """The homography (3,3) from the ground, counted from `corner`, to pixels."""
        optical = np.column_stack([turn[:2].T, turn.T @ [*(corner - eye[:2]), -eye[2]]])
        focal = 1 / self._camera.pixel
        # A pixel's number is half less than its middle.
        centre = (np.array([len(self._camera.u), len(self._camera.v)]) - 1) / 2
        return np.asarray(np.array([[focal, 0.0, centre[0]], [0.0, focal, centre[1]], [0.0, 0.0, 1.0]]) @ optical)


def _span(chosen: NDArray[np.bool_]) -> slice | None:
    """From the first to the last row that is chosen, None if there is none."""
    rows = np.flatnonzero(chosen)
    return slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) else None


def _pyramid(ground: Image) -> tuple[Image, NDArray[np.float32], NDArray[np.float32]]:
    """The texture and its halved copies side by side in one picture, their sizes and the left edges of each.

    Every copy has its last row and column also before the first, and the first behind the last: a tile needs no look
    beyond its edge.
    """
    levels = [ground.astype(np.float32)]
    while len(levels[-1]) > 1:
        half = len(levels[-1]) // 2
        levels.append(levels[-1].reshape(half, 2, half, 2, 3).mean(axis=(1, 3)))
    sizes = np.array([len(level) for level in levels])
    ends = np.cumsum(sizes + 2)
    picture = np.zeros((len(ground) + 2, int(ends[-1]), 3), np.uint8)
    for level, size, end in zip(levels, sizes, ends, strict=True):
        picture[: size + 2, end - size - 2 : end] = np.pad(to_image(level), ((1, 1), (1, 1), (0, 0)), mode="wrap")
    return picture, sizes.astype(np.float32), (ends - sizes - 2 + 0.5).astype(np.float32)
