"""The contract of a YOLOv5 export: which ONNX files keep it, and what their metadata say."""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.session import Session, Shape, Tensor, written

Anchors = NDArray[np.float32]
"""Widths and heights of the anchor boxes (heads, 3, 2) in pixels of the input."""
Layout = Literal["decoded", "heads", "planes"]
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
_DTYPES: Mapping[str, np.dtype[np.floating]] = {"float": np.dtype(np.float32), "float16": np.dtype(np.float16)}
_FINEST_STRIDE_PX = 8


@dataclass(frozen=True, slots=True, eq=False)
class Contract:
    """What a detector takes and gives. `input_px` is (height, width), None where free.

    `confidence` holds the model's own thresholds by class, empty where its metadata have none. `anchors` matter only
    where the outputs are raw.
    """

    path: Path
    names: tuple[str, ...]
    stride_px: int
    input_px: tuple[int | None, int | None]
    dtype: np.dtype[np.floating]
    layout: Layout
    anchors: Anchors
    confidence: Mapping[str, float]

    @property
    def strides_px(self) -> tuple[int, ...]:
        """Pixels per cell of each head, the finest first."""
        return strides(self.stride_px)

    def expected(self, input_px: tuple[int | None, int | None]) -> tuple[Shape, ...]:
        """The shapes of the outputs for an input (height, width)."""
        return expected_outputs(self.layout, input_px, self.stride_px, len(self.names))


def strides(coarsest_px: int) -> tuple[int, ...]:
    """Pixels per cell of each head: 8, 16, 32, and 64 where a model has four."""
    return tuple(_FINEST_STRIDE_PX << i for i in range((coarsest_px // _FINEST_STRIDE_PX).bit_length()))


def expected_outputs(
    layout: Layout, input_px: tuple[int | None, int | None], stride_px: int, classes: int
) -> tuple[Shape, ...]:
    """The shapes of the outputs of a model with so many classes; None where a free input leaves them free."""
    height, width = input_px
    grids = [
        (None if height is None else height // stride, None if width is None else width // stride)
        for stride in strides(stride_px)
    ]
    if layout == "heads":
        return tuple((1, 3, h, w, 5 + classes) for h, w in grids)
    if layout == "planes":
        return tuple((1, 3 * (5 + classes), h, w) for h, w in grids)
    cells = None if height is None or width is None else sum(3 * (h or 0) * (w or 0) for h, w in grids)
    return ((1, cells, 5 + classes),)


def fits(found: Sequence[int | None], expected: Shape) -> bool:
    """Whether two shapes agree wherever both are known."""
    pairs = zip(found, expected, strict=False)
    return len(found) == len(expected) and all(a == b or a is None or b is None for a, b in pairs)


def read_contract(session: Session, names_file: Path | None, anchors: str) -> Contract:
    """The contract that a model keeps. `anchors` (a key of ANCHORS) counts where the metadata have none.

    Raises:
        ModelError: it is no YOLOv5 detector, or its metadata cannot be read.
    """
    names = names_of(session, names_file)
    stride_px = _metadata(session, "stride", 32)
    if isinstance(stride_px, Sequence) and stride_px:
        stride_px = max(stride_px)
    if stride_px not in (32, 64):
        raise ModelError(f"{session.path}: stride {stride_px} in the metadata; a YOLOv5 detector has 32 or 64")
    stride_px = int(stride_px)
    layout, input_px = _shapes(session, stride_px, len(names))
    return Contract(
        session.path,
        names,
        stride_px,
        input_px,
        _DTYPES[session.inputs[0].dtype],
        layout,
        _anchors(session, anchors, layout, stride_px),
        _thresholds(session, names),
    )


def names_of(session: Session, names_file: Path | None) -> tuple[str, ...]:
    """The class names by class id: lines of a file, else the metadata's `names`.

    Raises:
        ModelError: there are none.
    """
    if names_file is not None:
        try:
            lines = names_file.read_text().split("\n")
        except (OSError, UnicodeDecodeError) as error:
            raise ModelError(f"{names_file}: not a text file of class names, one per line: {error}") from error
        names = tuple(line.strip() for line in lines if line.strip())
    else:
        found = _metadata(session, "names", ())
        if isinstance(found, Mapping):
            found = [found.get(i) for i in range(len(found))]
        names = tuple(name for name in found if isinstance(name, str)) if isinstance(found, Sequence) else ()
        if not isinstance(found, Sequence) or len(names) != len(found):
            raise ModelError(f"{session.path}: the names in its metadata cannot be read; give --names FILE")
    if not names:
        raise ModelError(f"{session.path}: it has no class names in its metadata; give --names FILE, one name per line")
    return names


def _shapes(session: Session, stride_px: int, classes: int) -> tuple[Layout, tuple[int | None, int | None]]:
    inputs, outputs = session.inputs, session.outputs
    if len(inputs) == 1 and fits(inputs[0].shape, (1, 3, None, None)) and inputs[0].dtype in _DTYPES:
        height, width = inputs[0].shape[2:]
        whole = all(side is None or side % stride_px == 0 for side in (height, width))
        layouts: tuple[Layout, ...] = ("decoded", "heads", "planes")
        for layout in layouts if whole else ():
            expected = expected_outputs(layout, (height, width), stride_px, classes)
            # Old exports give the raw heads behind the decoded output, too.
            found = outputs[:1] if layout == "decoded" and _is_old(outputs) else outputs
            if len(found) == len(expected) and all(map(fits, (entry.shape for entry in found), expected)):
                return layout, (height, width)
    raise ModelError(_refusal(session, stride_px, classes))


def _is_old(outputs: Sequence[Tensor]) -> bool:
    return len(outputs) > 1 and len(outputs[0].shape) == 3 and all(len(entry.shape) == 5 for entry in outputs[1:])


def _refusal(session: Session, stride_px: int, classes: int) -> str:
    shape = session.inputs[0].shape if len(session.inputs) == 1 else ()
    size = (shape[2], shape[3]) if len(shape) == 4 else (None, None)
    decoded = written(expected_outputs("decoded", size, stride_px, classes)[0])
    heads = ", ".join(map(written, expected_outputs("heads", size, stride_px, classes)))
    wanted = written((1, 3, *size))
    return (
        f"{session.path}: not a YOLOv5 detector of {classes} classes: found input {', '.join(map(str, session.inputs))}"
        f" and output {', '.join(map(str, session.outputs))}; expected one input {wanted} float or float16 (sides in "
        f"multiples of {stride_px}) and output {decoded}, or raw heads {heads}; export it again, or give the right "
        "--names FILE"
    )


def _metadata(session: Session, key: str, default: Any) -> Any:  # noqa: ANN401 - any literal
    text = session.metadata.get(key)
    if text is None:
        return default
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError) as error:
        raise ModelError(f"{session.path}: {key} in the metadata is {text[:60]!r}; export the model again") from error


def _anchors(session: Session, chosen: str, layout: Layout, stride_px: int) -> Anchors:
    own = _metadata(session, "anchors", None)
    try:
        anchors = ANCHORS[chosen] if own is None else np.array(own, dtype=np.float32).reshape(-1, 3, 2)
    except (ValueError, TypeError) as error:
        raise ModelError(f"{session.path}: the anchors in its metadata are not heads x 3 x 2 numbers") from error
    if layout != "decoded" and len(anchors) != len(strides(stride_px)):
        raise ModelError(
            f"{session.path}: {len(anchors)} heads have anchors, but the model has {len(strides(stride_px))}; "
            "add its anchors to the metadata, or export the decoded output"
        )
    return anchors


def _thresholds(session: Session, names: tuple[str, ...]) -> dict[str, float]:
    """The metadata's `confidence`: one number, or a number by class name."""
    own = _metadata(session, "confidence", {})
    by_class = own if isinstance(own, Mapping) else dict.fromkeys(names, own)
    if not all(
        name in names and isinstance(value, int | float) and 0 <= value <= 1 for name, value in by_class.items()
    ):
        raise ModelError(
            f"{session.path}: confidence in its metadata is neither 0 to 1 nor such numbers by its own class names "
            f"({', '.join(names)}); rename its keys too, or take it out of the metadata and set detect.confidence"
        )
    return {name: float(value) for name, value in by_class.items()}
