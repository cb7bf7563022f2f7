"""Detectors whose graph ends in non-maximum suppression: boxes by their corners, each with a score and a class.

As YOLOv10 and 26, exports of Ultralytics with `nms=True` and of YOLOv7 with `--end2end`, and EfficientNMS give them.
Source: Wang et al., YOLOv10, NeurIPS 2024; WongKinYiu, YOLOv7, `models/experimental.py`, ONNX_ORT; NVIDIA, TensorRT,
`plugin/efficientNMSPlugin`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.families._candidates import candidates_of_classes
from mcap_landmarks.vision.families._cells import count_of_cells
from mcap_landmarks.vision.family import DetectionCandidates, Family, ModelLayout, Signature
from mcap_landmarks.vision.onnx_session import Shape, Tensor, fits

Form = Literal["six", "seven", "parts"]
"""Rows [1, N, 6] of corners, score, class; or [N, 7] of image, corners, class, score; or four outputs: how many of the
N rows count, corners [1, N, 4], scores [1, N] and classes [1, N]."""

_STRIDES = (8, 16, 32)
_PARTS = (("num",), ("box",), ("score",), ("class", "label"))
"""Words in the names of the four outputs: `num_dets`, `det_boxes`, `det_scores`, `det_classes` and the like."""


@dataclass(frozen=True, slots=True, eq=False)
class SuppressedLayout(ModelLayout):
    """The outputs of one model, of shapes as declared; `parts_at` are the places of the four."""

    form: Form
    shapes: tuple[Shape, ...]
    parts_at: tuple[int, ...] = ()

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        del input_px
        return self.shapes

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; in the network's order."""
        del input_px
        if self.form == "parts":
            count, boxes, scores, class_ids = (outputs[i] for i in self.parts_at)
            # The rows behind those that count hold anything.
            used = slice(0, max(0, int(np.nan_to_num(count).ravel()[0])))
            boxes, scores, class_ids = boxes[0, used], scores[0, used], class_ids[0, used]
        elif self.form == "six":
            boxes, scores, class_ids = np.split(outputs[0][0], [4, 5], axis=1)
        else:
            _, boxes, class_ids, scores = np.split(outputs[0], [1, 5, 6], axis=1)
        flat = scores.astype(np.float32).ravel(), class_ids.ravel()
        return candidates_of_classes(boxes.astype(np.float32), *flat, thresholds)


def recognise(signature: Signature) -> SuppressedLayout | str:
    """The layout of a model with such outputs, else what one has."""
    input_px = signature.image_px()
    if input_px is not None and len(signature.inputs) == 1:
        shapes = tuple(entry.shape for entry in signature.outputs)
        if len(shapes) == 1 and _is_six(signature, shapes[0]):
            return SuppressedLayout(input_px, _STRIDES[-1], "six", ((1, shapes[0][1], 6),))
        if len(shapes) == 1 and fits(shapes[0], (None, 7)) and shapes[0][1] == 7:
            return SuppressedLayout(input_px, _STRIDES[-1], "seven", shapes, by_image=False)
        places = _parts(signature.outputs)
        if places:
            return SuppressedLayout(input_px, _STRIDES[-1], "parts", shapes, places)
    return "[1, boxes, 6], or num_dets, boxes, scores and classes"


def _is_six(signature: Signature, shape: Shape) -> bool:
    if not fits(shape, (1, None, 6)):
        return False
    if signature.stated == "nms_in_graph":
        return True
    # As many rows as a grid has cells are the heads of a detector of one class; free ones of one whose exporter says
    # the stride, too.
    count = count_of_cells(signature.image_px() or (None, None), _STRIDES) or 0
    are_heads = shape[1] in (count, 3 * count) if shape[1] else "stride" in signature.metadata
    return shape[2] == 6 and not (are_heads and signature.classes == 1)


def _parts(outputs: Sequence[Tensor]) -> tuple[int, ...]:
    """The places of the four outputs, none if they are not these."""
    named = [_named(outputs, words) for words in _PARTS]
    if len(outputs) != len(_PARTS) or None in named:
        return ()
    places = tuple(place for place in named if place is not None)
    count, boxes, scores, classes = (outputs[place].shape for place in places)
    rows = boxes[1] if len(boxes) == 3 else None
    fitting = fits(boxes, (1, rows, 4)) and fits(scores, (1, rows)) and fits(classes, (1, rows))
    return places if fitting and len(count) <= 2 else ()


def _named(outputs: Sequence[Tensor], words: tuple[str, ...]) -> int | None:
    """The place of the one output whose name has one of these words."""
    found = [i for i, entry in enumerate(outputs) if any(word in entry.name for word in words)]
    return found[0] if len(found) == 1 else None


FAMILY = Family("nms_in_graph", "NMS in the graph", recognise, needs_nms=False)
