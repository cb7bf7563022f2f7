"""Non-maximum suppression: of boxes of one class that overlap, the best stays."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.letterbox import Boxes


def suppress(
    boxes_xyxy: Boxes, scores: NDArray[np.float32], class_ids: NDArray[np.intp], iou: float, most: int
) -> NDArray[np.intp]:
    """Indices of the boxes (N, 4) that stay, best first (of equal scores the first), at most `most`.

    A box goes if its intersection over union with a better one of the same class that stays is above `iou`.
    """
    order = np.argsort(-scores, kind="stable")
    boxes, classes = boxes_xyxy[order], class_ids[order]
    left, top, right, bottom = boxes.T
    areas = (right - left) * (bottom - top)
    alive = np.ones(len(order), dtype=np.bool_)
    kept: list[int] = []
    position = 0
    while position < len(order) and len(kept) < most:
        kept.append(position)
        rest = slice(position + 1, None)
        width = np.minimum(right[rest], right[position]) - np.maximum(left[rest], left[position])
        height = np.minimum(bottom[rest], bottom[position]) - np.maximum(top[rest], top[position])
        overlap = np.maximum(width, 0) * np.maximum(height, 0)
        union = areas[rest] + areas[position] - overlap
        # Without a division, which boxes of no area would make 0 / 0.
        alive[rest] &= (overlap <= np.float32(iou) * union) | (classes[rest] != classes[position])
        left_over = np.flatnonzero(alive[rest])
        position = position + 1 + int(left_over[0]) if len(left_over) else len(order)
    return order[kept]
