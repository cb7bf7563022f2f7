"""YOLOv5 and YOLOv7 (also v3 and v6's of the same head): boxes as offsets from anchors, with an objectness each.

Source: Ultralytics, YOLOv5, `models/yolo.py`, Detect; Wang, Bochkovskiy and Liao, YOLOv7, CVPR 2023, has the same head.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.families._candidates import candidates_by_objectness
from mcap_landmarks.vision.family import DetectionCandidates, Family, ImageSides, ModelLayout, Signature
from mcap_landmarks.vision.onnx_session import Shape, Tensor, fits, written

Anchors = NDArray[np.float32]
"""Widths and heights of the anchor boxes (heads, 3, 2) in pixels of the input."""
Form = Literal["decoded", "heads", "planes"]
"""One output [1, N, 5 + classes]; or per head [1, 3, H, W, 5 + classes]; or per head [1, 3 * (5 + classes), H, W]."""

ANCHORS: Mapping[str, Anchors] = {
    # As published with the weights on COCO: YOLOv5 (also v3 and v6's of the same head), and YOLOv7.
    "yolov5": np.array(
        [[10, 13, 16, 30, 33, 23], [30, 61, 62, 45, 59, 119], [116, 90, 156, 198, 373, 326]], dtype=np.float32
    ).reshape(3, 3, 2),
    "yolov7": np.array(
        [[12, 16, 19, 36, 40, 28], [36, 75, 76, 55, 72, 146], [142, 110, 192, 243, 459, 401]], dtype=np.float32
    ).reshape(3, 3, 2),
}
_FINEST_STRIDE_PX = 8
_COARSEST_STRIDES_PX = (32, 64)
"""Of models with three and with four heads."""


@dataclass(frozen=True, slots=True, eq=False)
class AnchorLayout(ModelLayout):
    """The outputs of one model; `anchors` matter only where they are raw."""

    classes: int
    form: Form
    anchors: Anchors

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        return output_shapes(self.form, input_px, self.stride_px, self.classes)

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; a score is objectness times probability. In the order of the network's cells."""
        del input_px
        lowest = float(thresholds.min())
        if self.form == "decoded":
            rows = outputs[0][0]
            return candidates_by_objectness(rows[rows[:, 4] > lowest].astype(np.float32), thresholds)
        rows_by_head = []
        for stride_px, anchors, (raw, *_) in zip(strides(self.stride_px), self.anchors, outputs, strict=True):
            split = split_planes(raw, 5 + self.classes) if self.form == "planes" else raw
            rows_by_head.append(head_rows(split, stride_px, anchors, lowest))
        return candidates_by_objectness(np.concatenate(rows_by_head), thresholds)


def recognise(signature: Signature) -> AnchorLayout | str:
    """The layout of a model with such anchors, else what one of as many classes has.

    Raises:
        ModelError: the outputs are raw, and the anchors in the metadata are not theirs.
    """
    stride_px = signature.value("stride")
    if isinstance(stride_px, Sequence) and stride_px:
        stride_px = max(stride_px)
    if stride_px is None:
        stride_px = _COARSEST_STRIDES_PX[0]
    if not isinstance(stride_px, int | float) or stride_px not in _COARSEST_STRIDES_PX:
        return f"stride {' or '.join(map(str, _COARSEST_STRIDES_PX))} in place of stride {stride_px} in the metadata"
    stride_px = int(stride_px)
    form = _form(signature, stride_px)
    if form is None:
        return _expected(signature, stride_px)
    height, width = signature.inputs[0].shape[2:]
    return AnchorLayout((height, width), stride_px, signature.classes, form, _anchors(signature, form, stride_px))


def strides(coarsest_px: int) -> tuple[int, ...]:
    """Pixels per cell of each head: 8, 16, 32, and 64 where a model has four."""
    return tuple(_FINEST_STRIDE_PX << i for i in range((coarsest_px // _FINEST_STRIDE_PX).bit_length()))


def output_shapes(form: Form, input_px: ImageSides, stride_px: int, classes: int) -> tuple[Shape, ...]:
    """The shapes of the outputs of a model with so many classes; None where a free input leaves them free."""
    height, width = input_px
    if form == "decoded":
        boxes = None if height is None or width is None else _boxes(height, width, stride_px)
        return ((1, boxes, 5 + classes),)
    grids = [(_cells(height, stride), _cells(width, stride)) for stride in strides(stride_px)]
    if form == "heads":
        return tuple((1, 3, rows, columns, 5 + classes) for rows, columns in grids)
    return tuple((1, 3 * (5 + classes), rows, columns) for rows, columns in grids)


def _cells(side_px: int | None, stride_px: int) -> int | None:
    return None if side_px is None else side_px // stride_px


def _boxes(height_px: int, width_px: int, stride_px: int) -> int:
    """How many boxes all heads give: three in each cell."""
    return sum(3 * (height_px // stride) * (width_px // stride) for stride in strides(stride_px))


def split_planes(raw: NDArray[Any], columns: int) -> NDArray[Any]:
    """The planes (3 * columns, H, W) of one raw head as (3, H, W, columns)."""
    return raw.reshape(3, columns, *raw.shape[1:]).transpose(0, 2, 3, 1)


def head_rows(raw: NDArray[Any], stride_px: int, anchors: Anchors, lowest: float) -> NDArray[np.float32]:
    """Rows (N, 5 + classes) of one raw head (3, H, W, 5 + classes) whose objectness is above `lowest`."""
    anchor, v, u = np.nonzero(_sigmoid(raw[..., 4].astype(np.float32)) > lowest)
    rows = _sigmoid(raw[anchor, v, u].astype(np.float32))
    cells = np.stack([u, v], axis=1).astype(np.float32)
    rows[:, 0:2] = (rows[:, 0:2] * 2 - np.float32(0.5) + cells) * np.float32(stride_px)
    rows[:, 2:4] = (rows[:, 2:4] * 2) ** 2 * anchors[anchor]
    return rows


def _sigmoid(values: NDArray[np.float32]) -> NDArray[np.float32]:
    # exp(80) still fits into 32 bits.
    shares: NDArray[np.float32] = np.float32(1) / (np.float32(1) + np.exp(np.clip(-values, -80, 80)))
    return shares


def _form(signature: Signature, stride_px: int) -> Form | None:
    outputs, input_px = signature.outputs, signature.image_px(stride_px)
    if len(signature.inputs) != 1 or input_px is None:
        return None
    forms: tuple[Form, ...] = ("decoded", "heads", "planes")
    for form in forms:
        expected = output_shapes(form, input_px, stride_px, signature.classes)
        # Old exports give the raw heads behind the decoded output, too.
        found = outputs[:1] if form == "decoded" and _is_old(outputs) else outputs
        if len(found) == len(expected) and all(map(fits, (entry.shape for entry in found), expected)):
            return form
    return None


def _is_old(outputs: Sequence[Tensor]) -> bool:
    return len(outputs) > 1 and len(outputs[0].shape) == 3 and all(len(entry.shape) == 5 for entry in outputs[1:])


def _expected(signature: Signature, stride_px: int) -> str:
    size = signature.image_px() or (None, None)
    decoded = written(output_shapes("decoded", size, stride_px, signature.classes)[0])
    sides = "" if signature.image_px(stride_px) else f" (sides in multiples of {stride_px})"
    return f"{decoded} or raw heads{sides}"


def _anchors(signature: Signature, form: Form, stride_px: int) -> Anchors:
    own = signature.value("anchors") or "yolov5"
    try:
        known = ANCHORS.get(own) if isinstance(own, str) else None
        anchors = np.array(own, dtype=np.float32).reshape(-1, 3, 2) if known is None else known
    except (ValueError, TypeError) as error:
        raise ModelError(f"{signature.path}: the anchors in its metadata are not heads x 3 x 2 numbers") from error
    if form != "decoded" and len(anchors) != len(strides(stride_px)):
        raise ModelError(
            f"{signature.path}: {len(anchors)} heads have anchors, but the model has {len(strides(stride_px))}; "
            "add its anchors to the metadata, or export the decoded output"
        )
    return anchors


FAMILY = Family("yolov5", "YOLOv5 or YOLOv7", recognise, needs_nms=True)
