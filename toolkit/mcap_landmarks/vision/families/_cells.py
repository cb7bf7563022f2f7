"""The cells of an anchor-free detector: squares of several strides that cover the input, one box each."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.family import ImageSides


def count_of_cells(input_px: ImageSides, strides: tuple[int, ...]) -> int | None:
    """How many cells of all strides cover an input (height, width); None where a side is free."""
    height, width = input_px
    if height is None or width is None:
        return None
    return sum(-(-height // stride) * -(-width // stride) for stride in strides)


def cells(input_px: tuple[int, int], strides: tuple[int, ...]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The corner (N, 2), x and y in pixels, and the stride (N,) of each cell: row by row, the first stride first."""
    height, width = input_px
    corners, sides = [], []
    for stride in strides:
        rows, columns = np.mgrid[0 : -(-height // stride), 0 : -(-width // stride)]
        corners.append(np.stack([columns.ravel(), rows.ravel()], axis=1) * stride)
        sides.append(np.full(rows.size, stride))
    return np.concatenate(corners).astype(np.float32), np.concatenate(sides).astype(np.float32)
