"""DETR's descendants, RT-DETR, D-FINE and RF-DETR: a fixed number of boxes that need no non-maximum suppression.

Source: Carion et al., End-to-end object detection with transformers, ECCV 2020; Zhao et al., RT-DETR, CVPR 2024
(outputs: `tools/export_onnx.py`, and Ultralytics, `ultralytics/nn/modules/head.py`, RTDETRDecoder); Roboflow, RF-DETR,
`rfdetr/export` (outputs, and the mean and spread of ImageNet).
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.families._candidates import (
    best_classes,
    boxes_around,
    candidates_above,
    candidates_of_classes,
)
from mcap_landmarks.vision.families._cells import count_of_cells
from mcap_landmarks.vision.family import DetectionCandidates, Family, ImageSides, ModelLayout, Signature
from mcap_landmarks.vision.letterbox import Colours, stretched
from mcap_landmarks.vision.onnx_session import Shape, fits, written

Form = Literal["rows", "chosen", "tables", "processed"]
"""One output [1, N, 4 + classes] of boxes and scores (Ultralytics), lately [1, N, 6] of box, score and class; or boxes
[1, N, 4] and logits [1, N, classes] (RF-DETR, transformers); or labels [1, N], boxes [1, N, 4] by their corners and
scores [1, N], for the image size in a second input (RT-DETR, D-FINE). Boxes are shares of the input's sides, by centre
and size unless said otherwise."""

_STRIDE_PX = 32
_IMAGENET = Colours("rgb", (123.675, 116.28, 103.53), (58.395, 57.12, 57.375))
_TABLES = {("dets", "labels"): _IMAGENET, ("pred_boxes", "logits"): Colours()}
"""By the names of boxes and logits, RF-DETR's and transformers': how images are normalised."""
_PROCESSED = ("boxes", "scores", "labels")
_SIZES = "orig_target_sizes"


@dataclass(frozen=True, slots=True, eq=False)
class QueryLayout(ModelLayout):
    """The outputs of one model, of shapes as declared; `places` of the boxes first, then of what else the form has."""

    form: Form
    classes: int
    shapes: tuple[Shape, ...]
    places: tuple[int, ...]

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        del input_px
        return self.shapes

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; in the order of the network's queries."""
        boxes, *others = (outputs[place][0].astype(np.float32) for place in self.places)
        sides = np.array(input_px[::-1] * 2, np.float32)
        if self.form == "processed":
            return candidates_of_classes(boxes * sides, others[0], others[1], thresholds)
        corners = boxes_around(boxes) * sides
        if self.form == "chosen":
            return candidates_of_classes(corners, boxes[:, 4], boxes[:, 5], thresholds)
        scores = boxes[:, 4:] if self.form == "rows" else 1 / (1 + np.exp(np.clip(-others[0], -80, 80)))
        rows, class_ids, best = best_classes(scores, float(thresholds.min()))
        return candidates_above(corners[rows], best, class_ids, thresholds)


def recognise(signature: Signature) -> QueryLayout | str:
    """The layout of a model with such outputs, else what one of as many classes has."""
    input_px = signature.image_px()
    if input_px is not None:
        layout = _rows(signature, input_px) or _tables(signature, input_px) or _processed(signature, input_px)
        if layout is not None:
            return layout
    rows, logits = (written((1, None, columns)) for columns in (4 + signature.classes, signature.classes))
    return f"{rows}, or boxes [1, ?, 4] and logits {logits}, or labels, boxes and scores"


def _rows(signature: Signature, input_px: ImageSides) -> QueryLayout | None:
    if len(signature.inputs) != 1 or len(signature.outputs) != 1 or len(signature.outputs[0].shape) != 3:
        return None
    shape, is_told = signature.outputs[0].shape, signature.stated == "detr"
    # Where columns are free, or rows as many as cells, the metadata must tell: boxes of YOLO are in pixels.
    count = count_of_cells(input_px, (8, 16, 32))
    if not is_told and (shape[2] is None or (count and shape[1] == count)):
        return None
    if is_told and "head" in signature.metadata and fits(shape, (1, None, 6)):
        return _layout(signature, input_px, "chosen", (0,))
    return _layout(signature, input_px, "rows", (0,)) if fits(shape, (1, None, 4 + signature.classes)) else None


def _tables(signature: Signature, input_px: ImageSides) -> QueryLayout | None:
    names = [entry.name for entry in signature.outputs]
    for pair, colours in _TABLES.items():
        if len(signature.inputs) != 1 or sorted(names) != sorted(pair):
            continue
        places = tuple(names.index(name) for name in pair)
        boxes, logits = (signature.outputs[place].shape for place in places)
        if fits(boxes, (1, None, 4)) and fits(logits, (1, None, signature.classes)) and logits[2] is not None:
            return dataclasses.replace(_layout(signature, input_px, "tables", places), colours=colours)
    return None


def _processed(signature: Signature, input_px: ImageSides) -> QueryLayout | None:
    names = [entry.name for entry in signature.outputs]
    if [entry.name for entry in signature.inputs[1:]] != [_SIZES] or sorted(names) != sorted(_PROCESSED):
        return None
    places = tuple(names.index(name) for name in _PROCESSED)
    if not all(map(fits, (signature.outputs[i].shape for i in places), ((1, None, 4), (1, None), (1, None)))):
        return None
    # An image of one pixel leaves boxes as shares, whatever the size of the input.
    sizes = {_SIZES: np.ones((1, 2), np.int64)}
    return dataclasses.replace(_layout(signature, input_px, "processed", places), constants=sizes)


def _layout(signature: Signature, input_px: ImageSides, form: Form, places: tuple[int, ...]) -> QueryLayout:
    # Free shapes stay free, but for the columns that the form has.
    columns = {"rows": 4 + signature.classes, "chosen": 6}
    shapes = tuple((*entry.shape[:-1], columns.get(form, entry.shape[-1])) for entry in signature.outputs)
    return QueryLayout(input_px, _STRIDE_PX, form, signature.classes, shapes, places, place=stretched)


FAMILY = Family("detr", "RT-DETR, D-FINE or RF-DETR", recognise, needs_nms=False)
