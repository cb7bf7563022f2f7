"""A network's detections in pictures, while it is being trained: decoded, suppressed, scored."""

from collections.abc import Sequence

import cv2
import numpy as np
import torch

from mcap_landmarks_generator.training.examples import CLASS_IDS
from mcap_landmarks_generator.training.network import Network
from mcap_landmarks_generator.training.pictures import Image
from mcap_landmarks_generator.training.scoring import Found

_LEAST_SCORE, _OVERLAP, _MOST = 0.02, 0.45, 300
_BATCH = 8


@torch.no_grad()
def detect(network: Network, images: Sequence[Image]) -> list[Found]:
    """What a network finds in images (H, W, 3) of one size, both sides multiples of 32."""
    device = next(network.parameters()).device
    found = []
    for first in range(0, len(images), _BATCH):
        array = torch.from_numpy(np.stack(images[first : first + _BATCH])).to(device).permute(0, 3, 1, 2)
        inputs = (array.float() / 255).contiguous(memory_format=torch.channels_last)
        with torch.autocast(device.type, torch.bfloat16, enabled=device.type != "cpu"):
            raw = network(inputs)
        rows = network.decode([out.float() for out in raw]).cpu().numpy()
        found += [_found(row) for row in rows]
    return found


def _found(rows: np.ndarray[tuple[int, int], np.dtype[np.float32]]) -> Found:
    rows = rows[rows[:, 4] > _LEAST_SCORE]
    scores = (rows[:, 4:5] * rows[:, 5:]).astype(np.float64)
    best = scores.argmax(axis=1) if len(rows) else np.zeros(0, int)
    scores = scores[np.arange(len(rows)), best]
    boxes = np.hstack([rows[:, :2] - rows[:, 2:4] / 2, rows[:, 2:4]]).astype(np.float64)
    chosen = cv2.dnn.NMSBoxesBatched(
        boxes.tolist(), scores.tolist(), best.tolist(), _LEAST_SCORE, _OVERLAP, top_k=_MOST
    )
    kept = np.asarray(chosen, dtype=np.intp).reshape(-1)
    corners = np.hstack([boxes[kept, :2], boxes[kept, :2] + boxes[kept, 2:]])
    return Found(corners, scores[kept], CLASS_IDS[best[kept]])
