"""Tiles: parts of a large image that are looked at beside the whole, and what of their boxes is kept.

As in Akyon, Altinuc and Temizel, Slicing aided hyper inference, ICIP 2022.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.nms import suppress

OVERLAP = 0.2
"""Share of a tile that its neighbour sees, too (the paper's 0.2 to 0.25): what is smaller than that is whole in one."""
_MOST_PER_SIDE = 4
"""Where the number of tiles is free: the time grows with it. An image of 1920 x 1208 pixels has 12 tiles of 640."""
_BORDER_SHARE = 0.01
"""A box that ends so near to a tile's inner border, in shares of the tile's side, ends there because the tile does: a
stride of the finest cells, 8 pixels of 640, is about what borders are off."""
_PART_SHARE = 0.7
"""A box of which so much lies in another one's is a part of that object, if the other reaches out of its tile."""


@dataclass(frozen=True, slots=True)
class Tile:
    """A part of an image, in pixels of it."""

    left_px: int
    top_px: int
    width_px: int
    height_px: int

    @property
    def box_xyxy(self) -> NDArray[np.float64]:
        """Its left, top, right and bottom (4,)."""
        ends = self.left_px + self.width_px, self.top_px + self.height_px
        return np.array([self.left_px, self.top_px, *ends], dtype=np.float64)


def tiles_of(image_px: tuple[int, int], input_px: tuple[int, int], wanted: int | Literal["auto"]) -> tuple[Tile, ...]:
    """The whole image (height, width), and the tiles that it is cut into for an input (height, width).

    A number is that of tiles along the longer side; along the other there are as many as give tiles the shape of the
    input. "auto" takes as few along each side as shrink none, and at most four.
    """
    whole = Tile(0, 0, image_px[1], image_px[0])
    if wanted == "auto":
        counts = [_count(side, inner) for side, inner in zip(image_px, input_px, strict=True)]
    else:
        longer = int(image_px[1] / input_px[1] > image_px[0] / input_px[0])
        length = _length(image_px[longer], wanted) / input_px[longer] * input_px[1 - longer]
        other = max(1, round((image_px[1 - longer] / length - OVERLAP) / (1 - OVERLAP)))
        counts = [other, wanted] if longer else [wanted, other]
    if counts == [1, 1]:
        return (whole,)
    rows, columns = (_spans(side, count) for side, count in zip(image_px, counts, strict=True))
    return whole, *(Tile(left, top, right - left, bottom - top) for top, bottom in rows for left, right in columns)


def _count(side_px: int, input_px: int) -> int:
    """How many tiles a side needs so that none is shrunk."""
    needed = max(1, math.ceil((side_px / input_px - OVERLAP) / (1 - OVERLAP)))
    return min(needed, _MOST_PER_SIDE)


def _length(side_px: int, count: int) -> float:
    """How long so many tiles are that overlap and cover a side."""
    return side_px / (count - (count - 1) * OVERLAP)


def _spans(side_px: int, count: int) -> list[tuple[int, int]]:
    """First and last pixel of each tile along a side."""
    length = _length(side_px, count)
    starts = [round(i * length * (1 - OVERLAP)) for i in range(count)]
    return [(start, min(side_px, round(start + length))) for start in starts]


def merged(
    boxes_xyxy: NDArray[np.float64],
    scores: NDArray[np.float32],
    class_ids: NDArray[np.intp],
    tile_ids: NDArray[np.intp],
    tiles: Sequence[Tile],
    iou: float,
    most: int,
) -> NDArray[np.intp]:
    """Indices of the boxes (N, 4) that stay, best first, of what was found in each tile; the first tile is the image.

    A box that its tile cuts off goes, and one of which most lies in a box of the same class that reaches out of the
    tile. Of what is left the best of those that overlap stays (`nms.suppress`).
    """
    edges = np.array([tile.box_xyxy for tile in tiles])
    near = np.abs(boxes_xyxy - edges[tile_ids]) <= _BORDER_SHARE * np.tile(edges[:, 2:] - edges[:, :2], 2)[tile_ids]
    uncut = np.flatnonzero(~(near & (edges[tile_ids] != edges[0])).any(axis=1))
    parts = _are_parts(boxes_xyxy[uncut], class_ids[uncut], edges[tile_ids[uncut]])
    left = uncut[~parts]
    kept = suppress(boxes_xyxy[left].astype(np.float32), scores[left], class_ids[left], iou, most)
    return left[kept]


def _are_parts(
    boxes_xyxy: NDArray[np.float64], class_ids: NDArray[np.intp], tiles_xyxy: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which boxes (N, 4) lie, for the most part, in one of the same class that reaches out of their tile (N, 4)."""
    low = np.maximum(boxes_xyxy[:, None, :2], boxes_xyxy[None, :, :2])
    high = np.minimum(boxes_xyxy[:, None, 2:], boxes_xyxy[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    areas = np.prod(boxes_xyxy[:, 2:] - boxes_xyxy[:, :2], axis=1)
    before = boxes_xyxy[None, :, :2] < tiles_xyxy[:, None, :2]
    beyond = boxes_xyxy[None, :, 2:] > tiles_xyxy[:, None, 2:]
    alike = class_ids[:, None] == class_ids[None, :]
    covered = alike & (before | beyond).any(axis=2) & (shared > _PART_SHARE * areas[:, None])
    parts: NDArray[np.bool_] = covered.any(axis=1)
    return parts
