"""YOLOX: anchor-free boxes as offsets from cells and logarithms of sizes, with an objectness each.

Source: Ge et al., YOLOX, 2021; Megvii, YOLOX, `yolox/models/yolo_head.py` (`decode_outputs`), exported without
`--decode_in_inference`, and `yolox/data/data_augment.py` (`preproc`: at the top left, blue first, 0 to 255).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.families._candidates import candidates_by_objectness
from mcap_landmarks.vision.families._cells import cells, count_of_cells
from mcap_landmarks.vision.family import DetectionCandidates, Family, ModelLayout, Signature
from mcap_landmarks.vision.letterbox import Colours, fit_top_left
from mcap_landmarks.vision.onnx_session import Shape, fits, written

_STRIDES = (8, 16, 32)
_COLOURS = Colours("bgr", std=(1.0, 1.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class CellOffsetLayout(ModelLayout):
    """The one output of one model; objectness and class scores are probabilities already."""

    classes: int

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        return ((1, count_of_cells(input_px, _STRIDES), 5 + self.classes),)

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; a score is objectness times probability. In the order of the network's cells."""
        kept = np.flatnonzero(outputs[0][0][:, 4] > float(thresholds.min()))
        rows = outputs[0][0][kept].astype(np.float32)
        corners, sides = (part[kept] for part in cells(input_px, _STRIDES))
        rows[:, 0:2] = rows[:, 0:2] * sides[:, None] + corners
        with np.errstate(over="ignore"):  # a broken network's numbers are sorted out later
            rows[:, 2:4] = np.exp(rows[:, 2:4]) * sides[:, None]
        return candidates_by_objectness(rows, thresholds)


def recognise(signature: Signature) -> CellOffsetLayout | str:
    """The layout of a model with such an output, else what one of as many classes has."""
    outputs, input_px = signature.outputs, signature.image_px(_STRIDES[-1])
    shape = (1, count_of_cells(input_px or (None, None), _STRIDES), 5 + signature.classes)
    is_one = len(signature.inputs) == len(outputs) == 1 and fits(outputs[0].shape, shape)
    # Where sides are free the output is like YOLOv5's, whose exporter says the stride.
    is_told = outputs[0].shape[1] is not None or "stride" not in signature.metadata if is_one else False
    if input_px is None or not (is_told or (signature.stated == "yolox" and is_one)):
        return written(shape)
    return CellOffsetLayout(input_px, _STRIDES[-1], signature.classes, colours=_COLOURS, place=fit_top_left)


FAMILY = Family("yolox", "YOLOX", recognise, needs_nms=True)
