"""What a camera sees where no object is: the sky, and the ground with the shadows that lie on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from generator.assets import sky
from generator.assets.asset import Asset
from generator.assets.solid import rotation
from generator.assets.texture import Image, look_up

Floats = NDArray[np.floating]

SHADOW_CELL_M = 0.02
SHADOW_BLUR_M = 0.03
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
        self._levels = levels

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
        place = np.asarray(eye, np.float32)
        rays = directions.reshape(-1, 3).astype(np.float32)
        downwards = rays[:, 2] < -1e-5
        image = np.empty((len(rays), 3), np.uint8)
        image[~downwards] = sky.sample(self._panorama, rays[~downwards])
        rays = rays[downwards]
        distance = place[2] / -rays[:, 2]
        points = place[:2] + distance[:, None] * rays[:, :2]
        # A pixel covers a far patch that is long along the ray; the geometric mean of its sides is a fair compromise.
        footprint = pixel_rad * distance * np.sqrt(distance / place[2])
        colours = self._ground(points, footprint)
        for shadow in shadows:
            shadow.darken(colours, points, shade)
        image[downwards] = np.rint(colours).astype(np.uint8)
        return image.reshape(directions.shape)

    def _ground(self, points_xy: Floats, footprint_m: Floats) -> NDArray[np.float32]:
        """Ground colours (N,3) at points (N,2), each as if averaged over its footprint (N,)."""
        texel = self._tile_m / len(self._levels[0])
        wanted = np.rint(np.log2(np.maximum(footprint_m / texel, 1.0))).astype(int)
        level_of_point = np.minimum(wanted, len(self._levels) - 1)
        colours = np.empty((len(points_xy), 3), np.float32)
        for index in np.unique(level_of_point):
            level = self._levels[index]
            chosen = np.flatnonzero(level_of_point == index)
            place = np.mod(points_xy[chosen] / self._tile_m, 1.0) * len(level) - 0.5
            colours[chosen] = look_up(level, place[:, 0], len(level) - 1 - place[:, 1], repeats=True)
        return colours
