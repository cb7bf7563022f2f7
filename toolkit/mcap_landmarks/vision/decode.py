"""Outputs of a YOLOv5 network to boxes, classes and scores."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.contract import Contract
from mcap_landmarks.vision.letterbox import Boxes
from mcap_landmarks.vision.session import written


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """N boxes in pixels of the input: boxes_xyxy (N, 4), scores (N,), class_ids (N,)."""

    boxes_xyxy: Boxes
    scores: NDArray[np.float32]
    class_ids: NDArray[np.intp]

    def take(self, indices: NDArray[Any]) -> "Candidates":
        """Some of the boxes."""
        return Candidates(self.boxes_xyxy[indices], self.scores[indices], self.class_ids[indices])


def candidates(
    outputs: Sequence[NDArray[Any]],
    contract: Contract,
    input_px: tuple[int, int],
    thresholds: NDArray[np.float32],
) -> Candidates:
    """Boxes whose score, objectness times probability of their best class, is above that class's threshold (classes,).

    In the order of the network's cells; boxes or scores that are not finite are left out.

    Raises:
        ModelError: the outputs have other shapes than the contract says.
    """
    expected = contract.expected(input_px)
    used = outputs[: len(expected)]
    if [output.shape for output in used] != list(expected):
        found = ", ".join(written(output.shape) for output in outputs)
        raise ModelError(
            f"{contract.path}: for an input [1, 3, {input_px[0]}, {input_px[1]}] the outputs are {found}, but a YOLOv5 "
            f"detector of {len(contract.names)} classes gives {', '.join(map(written, expected))}; export it again"
        )
    lowest = float(thresholds.min())
    if contract.layout == "decoded":
        rows = used[0][0]
        rows = rows[rows[:, 4] > lowest].astype(np.float32)
    else:
        rows = np.concatenate([_head_rows(raw[0], contract, head, lowest) for head, raw in enumerate(used)])
    return _scored(rows, thresholds)


def _scored(rows: NDArray[np.float32], thresholds: NDArray[np.float32]) -> Candidates:
    """Candidates of rows (N, 5 + classes): centre, size, objectness, class probabilities."""
    class_ids = rows[:, 5:].argmax(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):  # a broken network's numbers are sorted out below
        scores = rows[:, 4] * rows[np.arange(len(rows)), 5 + class_ids]
    good = (scores > thresholds[class_ids]) & np.isfinite(rows[:, :4]).all(axis=1) & np.isfinite(scores)
    centres, halves = rows[good, 0:2], rows[good, 2:4] / 2
    boxes = np.concatenate([centres - halves, centres + halves], axis=1)
    return Candidates(boxes, scores[good], class_ids[good])


def _head_rows(raw: NDArray[Any], contract: Contract, head: int, lowest: float) -> NDArray[np.float32]:
    """Rows (N, 5 + classes) of one raw head whose objectness is above `lowest`, decoded as YOLOv5 does."""
    columns = 5 + len(contract.names)
    if contract.layout == "planes":
        raw = raw.reshape(3, columns, *raw.shape[1:]).transpose(0, 2, 3, 1)
    anchor, v, u = np.nonzero(_sigmoid(raw[..., 4].astype(np.float32)) > lowest)
    rows = _sigmoid(raw[anchor, v, u].astype(np.float32))
    cells = np.stack([u, v], axis=1).astype(np.float32)
    rows[:, 0:2] = (rows[:, 0:2] * 2 - np.float32(0.5) + cells) * np.float32(contract.strides_px[head])
    rows[:, 2:4] = (rows[:, 2:4] * 2) ** 2 * contract.anchors[head, anchor]
    return rows


def _sigmoid(values: NDArray[np.float32]) -> NDArray[np.float32]:
    shares: NDArray[np.float32] = np.float32(1) / (np.float32(1) + np.exp(np.clip(-values, -80, 80)))
    return shares
