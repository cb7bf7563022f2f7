"""Decoding and NMS of YOLOv5 as plain loops over single boxes, to judge the fast ones by."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Box = tuple[Any, Any, Any, Any, Any, int]
"""Left, top, right, bottom, score, class."""


def decoded_boxes(rows: NDArray[Any], threshold: Sequence[float]) -> list[Box]:
    """Boxes of decoded rows (N, 5 + classes) above the threshold of their best class."""
    found: list[Box] = []
    for row in rows:
        best = 0
        for i in range(1, len(row) - 5):
            if row[5 + i] > row[5 + best]:
                best = i
        score = row[4] * row[5 + best]
        if row[4] > min(threshold) and score > threshold[best]:
            u, v, half_width, half_height = row[0], row[1], row[2] / 2, row[3] / 2
            found.append((u - half_width, v - half_height, u + half_width, v + half_height, score, best))
    return found


def head_rows(heads: Sequence[NDArray[Any]], anchors: NDArray[Any]) -> NDArray[np.float64]:
    """Decoded rows of raw heads [3, H, W, 5 + classes]."""
    rows = []
    for level, head in enumerate(heads):
        stride = 8 * 2**level
        for a in range(3):
            for y in range(head.shape[1]):
                for x in range(head.shape[2]):
                    s = 1 / (1 + np.exp(-head[a, y, x].astype(np.float64)))
                    centre = [(2 * s[0] - 0.5 + x) * stride, (2 * s[1] - 0.5 + y) * stride]
                    size = [4 * s[2] * s[2] * anchors[level, a, 0], 4 * s[3] * s[3] * anchors[level, a, 1]]
                    rows.append([*centre, *size, *s[4:]])
    return np.array(rows)


def greedy(boxes: Sequence[Box], iou: float, most: int) -> list[Box]:
    """The boxes that stay, best first."""
    kept: list[Box] = []
    for box in sorted(boxes, key=lambda entry: -float(entry[4])):  # stable: of equal scores the first
        if len(kept) == most:
            break
        if all(box[5] != other[5] or overlap(box, other) <= iou for other in kept):
            kept.append(box)
    return kept


def overlap(one: Box, other: Box) -> float:
    """Intersection over union."""
    width = min(float(one[2]), float(other[2])) - max(float(one[0]), float(other[0]))
    height = min(float(one[3]), float(other[3])) - max(float(one[1]), float(other[1]))
    if width <= 0 or height <= 0:
        return 0.0
    areas = [float(b[2] - b[0]) * float(b[3] - b[1]) for b in (one, other)]
    return width * height / (sum(areas) - width * height)
