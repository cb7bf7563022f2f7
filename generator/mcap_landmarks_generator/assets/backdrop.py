"""What a camera sees where no object is: the sky, and the ground with the shadows that lie on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks_generator.assets import sky
from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.assets.solid import rotation
from mcap_landmarks_generator.assets.texture import Image, look_up, to_image

Floats = NDArray[np.floating]

SHADOW_CELL_M = 0.02
SHADOW_BLUR_M = 0.03
# Rays flatter than this meet no ground.
LOWEST_RAY = np.float32(-1e-5)
# A low sun would throw shadows without end.
LOWEST_LIGHT = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class Shadow:
    """Darkness (N,M) in 0..1 on a patch of ground: rows along y, columns along x, from the corner `low_xy` (2,)."""

    darkness: NDArray[np.float32]
    low_xy: Floats

    def at(self, x_m: float, y_m: float) -> Self:
        """The shadow, moved with its object."""
        return replace(self, low_xy=self.low_xy + np.array([x_m, y_m]))

    def darken(self, colours: Floats, points_xy: Floats, share: float) -> None:
        """Take up to `share` of the light from colours (N,3) of the ground at points (N,2), in place."""
        place = (points_xy - self.low_xy.astype(points_xy.dtype)) * (1 / SHADOW_CELL_M) - 0.5
        height, width = self.darkness.shape
        x, y = place.T
        inside = np.flatnonzero((x > -1) & (x < width) & (y > -1) & (y < height))
        if len(inside):
            colours[inside] *= 1 - share * look_up(self.darkness, x[inside], y[inside], repeats=False)[:, None]


def cast_shadow(asset: Asset, yaw_rad: float, towards_light: ArrayLike) -> Shadow:
    """The shadow of an asset at the world's origin, turned by `yaw_rad`, under light from direction (3,)."""
    light = np.asarray(towards_light, float) / np.linalg.norm(towards_light)
    slope = light[:2] / max(light[2], LOWEST_LIGHT)
    turn = rotation((0, 0, 1), yaw_rad)
    meshes = [(part.vertices @ turn.T, part.faces) for part in asset.parts]
    flat = [(points[:, :2] - points[:, 2:] * slope, faces) for points, faces in meshes]
    margin = 3 * SHADOW_BLUR_M
    low = np.min([points.min(axis=0) for points, _ in flat], axis=0) - margin
    high = np.max([points.max(axis=0) for points, _ in flat], axis=0) + margin
    width, height = (int(n) for n in np.ceil((high - low) / SHADOW_CELL_M))
    mask = np.zeros((height, width), np.uint8)
    for points, faces in flat:
        for triangle in np.rint((points - low) / SHADOW_CELL_M * 16 - 8).astype(np.int32)[faces]:
            cv2.fillConvexPoly(mask, triangle, 255, cv2.LINE_8, 4)
    soft = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), SHADOW_BLUR_M / SHADOW_CELL_M)
    return Shadow(np.asarray(soft, np.float32), low)


class Backdrop:
    """A sky above an endless ground at z = 0.

    The ground is looked up in a pyramid of its texture, as fine as a pixel's footprint there: it does not flicker as
    the renderer's own ground does, and costs a tenth of its time.
    """

    def __init__(self, panorama: Image, ground: Image, tile_m: float = 2.0, brightness: float = 1.0) -> None:
        """`ground` (S,S,3), S a power of two, covers `tile_m` squared and repeats; `brightness` scales it."""
        self._panorama = panorama
        self._tile_m = tile_m
        levels = [np.clip(ground.astype(np.float32) * brightness, 0, 255)]
        while len(levels[-1]) > 1:
            half = len(levels[-1]) // 2
            levels.append(levels[-1].reshape(half, 2, half, 2, 3).mean(axis=(1, 3)))
        # With its first row and column again at the end, a tile needs no look beyond its edge.
        border = ((0, 1), (0, 1), (0, 0))
        self._levels: list[Image] = [np.pad(to_image(level), border, mode="wrap") for level in levels]

    def view(
        self,
        eye: ArrayLike,
        directions: Floats,
        pixel_rad: float,
        shadows: Sequence[Shadow] = (),
        shade: float = 0.5,
    ) -> Image:
        """The image (H,W,3) from `eye` (3,) along unit rays (H,W,3) in the world's frame, `pixel_rad` apart.

        `shade` is the share of light that a shadow takes.
        """
        place = np.asarray(eye, np.float64)
        rays = directions.astype(np.float32, copy=False)
        downwards = rays[..., 2] < LOWEST_RAY
        image = np.empty(rays.shape, np.uint8)
        above, below = _rows_with(~downwards), _rows_with(downwards)
        if above is not None:
            image[above] = sky.sample(self._panorama, rays[above].reshape(-1, 3)).reshape(rays[above].shape)
        if below is not None:
            ground = self._ground(place, rays[below], pixel_rad, shadows, shade)
            np.copyto(image[below], ground, where=downwards[below][..., None])
        return image

    def _ground(
        self, eye: Floats, rays: NDArray[np.float32], pixel_rad: float, shadows: Sequence[Shadow], shade: float
    ) -> Image:
        """The ground (h,W,3) along rays (h,W,3); of a ray that meets it nowhere, anything."""
        distance = np.float32(eye[2]) / np.maximum(-rays[..., 2], -LOWEST_RAY)
        # Counted from a corner of the tile below the eye: single precision is enough anywhere in the world.
        corner = np.floor(eye[:2] / self._tile_m) * self._tile_m
        points = (eye[:2] - corner).astype(np.float32) + distance[..., None] * rays[..., :2]
        # A pixel covers a far patch that is long along the ray; the geometric mean of its sides is a fair compromise.
        texel = self._tile_m / (len(self._levels[0]) - 1)
        footprint = np.float32(pixel_rad / texel) * distance * np.sqrt(distance / np.float32(eye[2]))
        wanted = np.rint(np.log2(np.maximum(footprint, 1.0))).astype(np.uint8)
        level_of_pixel = np.minimum(wanted, len(self._levels) - 1)
        colours = np.empty(rays.shape, np.uint8)
        for index, level in enumerate(self._levels):
            chosen = level_of_pixel == index
            rows = _rows_with(chosen)
            if rows is not None:
                np.copyto(colours[rows], self._tiled(level, points[rows]), where=chosen[rows][..., None])
        span = np.stack(
            [[axis.min(axis=1), axis.max(axis=1)] for axis in np.ascontiguousarray(np.moveaxis(points, 2, 0))]
        )
        for shadow in shadows:
            _darken_rows(replace(shadow, low_xy=shadow.low_xy - corner), colours, points, span, shade)
        return colours

    def _tiled(self, level: Image, points_xy: NDArray[np.float32]) -> Image:
        """Colours (h,W,3) of the ground at points (h,W,2) in one level of the pyramid, bilinear."""
        size = len(level) - 1
        place = points_xy * np.float32(size / self._tile_m)
        column, row = place[..., 0] - np.float32(0.5), np.float32(size - 0.5) - place[..., 1]
        column -= size * np.floor(column / size)
        row -= size * np.floor(row / size)
        return np.asarray(cv2.remap(level, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _rows_with(chosen: NDArray[np.bool_]) -> slice | None:
    """The rows from the first to the last with a chosen pixel, None if there is none."""
    rows = np.flatnonzero(chosen.any(axis=1))
    return slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) else None


def _darken_rows(
    shadow: Shadow, colours: Image, points: NDArray[np.float32], span: NDArray[np.float32], share: float
) -> None:
    """Let a shadow fall on ground colours (h,W,3) at points (h,W,2), in place.

    `span` has the least and greatest x and y (2,2,h) of each row: only rows that the shadow can reach are looked at.
    """
    height, width = shadow.darkness.shape
    high_xy = shadow.low_xy + SHADOW_CELL_M * np.array([width, height])
    meets = np.all((span[:, 0] < high_xy[:, None]) & (span[:, 1] > shadow.low_xy[:, None]), axis=0)
    rows = _rows_with(np.asarray(meets)[:, None])
    if rows is not None:
        darkened = colours[rows].reshape(-1, 3).astype(np.float32)
        shadow.darken(darkened, points[rows].reshape(-1, 2), share)
        colours[rows] = np.rint(darkened).astype(np.uint8).reshape(colours[rows].shape)
