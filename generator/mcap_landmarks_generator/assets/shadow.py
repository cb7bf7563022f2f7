"""Shadows of assets on the ground, cast once and laid on what the camera sees of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.assets.solid import rotation
from mcap_landmarks_generator.assets.texture import Image

Floats = NDArray[np.floating]

CELL_M = 0.02
BLUR_M = 0.03
LOWEST_LIGHT = 0.35
"""A low sun would throw shadows without end."""
_NEAR_M = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Shadow:
    """Darkness (N,M) in 0..1 on a patch of ground: rows along y, columns along x, from the corner `low_xy` (2,)."""

    darkness: NDArray[np.float32]
    low_xy: Floats

    def at(self, x_m: float, y_m: float) -> Self:
        """The shadow, moved with its object."""
        return replace(self, low_xy=self.low_xy + np.array([x_m, y_m]))

    def over(self, x_m: NDArray[np.float32], y_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """Darkness (H,W) of the ground at points x (H,W) and y (H,W), bilinear."""
        column, row = (
            (axis - np.float32(low + CELL_M / 2)) * np.float32(1 / CELL_M)
            for axis, low in zip((x_m, y_m), self.low_xy, strict=True)
        )
        return np.asarray(cv2.remap(self.darkness, column, row, cv2.INTER_LINEAR), np.float32)

    @property
    def corners_xy(self) -> Floats:
        """The corners (4,2) of its patch, in turn, with the half cell over which it fades out."""
        height, width = self.darkness.shape
        (left, low), (right, high) = self.low_xy - CELL_M, self.low_xy + CELL_M * np.array([width + 1, height + 1])
        return np.array([[left, low], [right, low], [right, high], [left, high]])


def cast_shadow(asset: Asset, yaw_rad: float, towards_light: ArrayLike) -> Shadow:
    """The shadow of an asset at the world's origin, turned by `yaw_rad`, under light from direction (3,)."""
    light = np.asarray(towards_light, float) / np.linalg.norm(towards_light)
    slope = light[:2] / max(light[2], LOWEST_LIGHT)
    turn = rotation((0, 0, 1), yaw_rad)
    meshes = [(part.vertices @ turn.T, part.faces) for part in asset.parts if not part.clear]
    flat = [(points[:, :2] - points[:, 2:] * slope, faces) for points, faces in meshes]
    margin = 3 * BLUR_M
    low = np.min([points.min(axis=0) for points, _ in flat], axis=0) - margin
    high = np.max([points.max(axis=0) for points, _ in flat], axis=0) + margin
    width, height = (int(n) for n in np.ceil((high - low) / CELL_M))
    mask = np.zeros((height, width), np.uint8)
    for points, faces in flat:
        for triangle in np.rint((points - low) / CELL_M * 16 - 8).astype(np.int32)[faces]:
            cv2.fillConvexPoly(mask, triangle, 255, cv2.LINE_8, 4)
    soft = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), BLUR_M / CELL_M)
    return Shadow(np.asarray(soft, np.float32), low)


@dataclass(frozen=True, slots=True, eq=False)
class GroundView:
    """What a camera sees of the ground: points x and y (H,W) in the middles of its pixels, the first `row` of them in
    the image, and the homography (3,3) from the ground to the image's pixels, depth along the axis as third."""

    x_m: NDArray[np.float32]
    y_m: NDArray[np.float32]
    row: int
    pixel_from_ground: Floats

    def block(self, corners_xy: Floats) -> tuple[slice, slice] | None:
        """Rows and columns of the pixels that may show a convex patch of ground with corners (N,2), None without."""
        seen = np.column_stack([corners_xy, np.ones(len(corners_xy))]) @ self.pixel_from_ground.T
        after = np.roll(seen, -1, axis=0)
        # Sutherland and Hodgman's clipping, against the plane just in front of the camera.
        crosses = (seen[:, 2] > _NEAR_M) != (after[:, 2] > _NEAR_M)
        share = (_NEAR_M - seen[crosses, 2]) / (after[crosses, 2] - seen[crosses, 2])
        cut = seen[crosses] + share[:, None] * (after[crosses] - seen[crosses])
        corners = np.concatenate([seen[seen[:, 2] > _NEAR_M], cut])
        if not len(corners):
            return None
        pixels = corners[:, :2] / corners[:, 2:] - [0, self.row]
        height, width = self.x_m.shape
        left, top = np.clip(np.floor(pixels.min(axis=0)), 0, (width, height)).astype(int)
        right, bottom = np.clip(np.ceil(pixels.max(axis=0)), 0, (width, height)).astype(int)
        return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def darken(colours: Image, ground: GroundView, shadows: Sequence[Shadow], share: float) -> None:
    """Take up to `share` of the light from the colours (H,W,3) of ground where shadows lie, in place."""
    light: NDArray[np.float32] | None = None
    blocks = []
    for shadow in shadows:
        block = ground.block(shadow.corners_xy)
        if block is not None:
            if light is None:
                light = np.ones(ground.x_m.shape, np.float32)
            light[block] *= 1 - np.float32(share) * shadow.over(ground.x_m[block], ground.y_m[block])
            blocks.append(block)
    if light is None:
        return
    rows = slice(min(rows.start for rows, _ in blocks), max(rows.stop for rows, _ in blocks))
    columns = slice(min(columns.start for _, columns in blocks), max(columns.stop for _, columns in blocks))
    part = cv2.merge([light[rows, columns]] * 3)
    colours[rows, columns] = cv2.multiply(colours[rows, columns], part, dtype=cv2.CV_8U)
