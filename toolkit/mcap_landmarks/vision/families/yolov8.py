"""YOLOv8 to 12 as Ultralytics exports them (also its YOLOv3 and v5 "u"): anchor-free, class scores and no objectness.

Source: Ultralytics, `ultralytics/nn/modules/head.py`, Detect: boxes by centre and size in pixels, then the scores.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.families._candidates import best_classes, boxes_around, candidates_above
from mcap_landmarks.vision.families._cells import count_of_cells
from mcap_landmarks.vision.family import DetectionCandidates, Family, ModelLayout, Signature
from mcap_landmarks.vision.onnx_session import Shape, fits, written

_STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32))
"""Of the usual head, and of those for large (P6) and for small objects (P2)."""


@dataclass(frozen=True, slots=True, eq=False)
class AnchorFreeLayout(ModelLayout):
    """The one output of one model."""

    classes: int
    strides: tuple[int, ...]

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        return ((1, 4 + self.classes, count_of_cells(input_px, self.strides)),)

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; in the order of the network's cells."""
        del input_px
        columns = outputs[0][0]
        rows, class_ids, scores = best_classes(columns[4:].T, float(thresholds.min()))
        boxes = boxes_around(columns[:4, rows].T.astype(np.float32))
        return candidates_above(boxes, scores, class_ids, thresholds)


def recognise(signature: Signature) -> AnchorFreeLayout | str:
    """The layout of a model with such an output, else what one of as many classes has."""
    outputs, input_px = signature.outputs, signature.image_px(32)
    count = count_of_cells(input_px or (None, None), _STRIDES[0])
    expected = written((1, 4 + signature.classes, count))
    if input_px is None or len(signature.inputs) != 1 or len(outputs) != 1 or len(outputs[0].shape) != 3:
        return expected
    if outputs[0].shape[1] is None and signature.stated != "yolov8":
        return expected
    # Where sides are free every head fits, and the stride in the metadata tells the usual one from that of P6.
    coarsest = signature.value("stride")
    for strides in sorted(_STRIDES, key=lambda strides: strides[-1] != coarsest):
        if fits(outputs[0].shape, (1, 4 + signature.classes, count_of_cells(input_px, strides))):
            return AnchorFreeLayout(input_px, strides[-1], signature.classes, strides)
    return expected


FAMILY = Family("yolov8", "YOLOv8 to 12", recognise, needs_nms=True)
