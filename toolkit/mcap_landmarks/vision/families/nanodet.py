"""NanoDet and NanoDet-Plus: class scores, and the distance to each side of the box as a distribution over bins.

Source: Li et al., Generalized Focal Loss, NeurIPS 2020 (the distributions); RangiLyu, NanoDet,
`nanodet/model/head/gfl_head.py` (cells of NanoDet) and `nanodet_plus_head.py` (cells of NanoDet-Plus).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.families._candidates import best_classes, candidates_above
from mcap_landmarks.vision.families._cells import cells, count_of_cells
from mcap_landmarks.vision.family import DetectionCandidates, Family, ImageSides, ModelLayout, Signature
from mcap_landmarks.vision.letterbox import Colours, fit_top_left
from mcap_landmarks.vision.onnx_session import Shape, fits

_STRIDES = {3: (8, 16, 32), 4: (8, 16, 32, 64)}
"""Of NanoDet and of NanoDet-Plus."""
_CENTRES = {3: 0.5, 4: 0.0}
"""Where in its cell a box is measured from, in strides: `get_single_level_center_point` of NanoDet adds a half,
`get_single_level_center_priors` of NanoDet-Plus nothing."""
_BINS = (8, 11, 17)
"""`reg_max` + 1 of upstream's configurations: 7 (m and Plus), 10 (g), 16 (the default). Where scores and bins share one
output, other numbers would let a wrong count of classes pass."""
_COLOURS = Colours("bgr", (103.53, 116.28, 123.675), (57.375, 57.12, 58.395), padding=0)
"""`normalize` of upstream's configurations; its warp leaves black margins."""


@dataclass(frozen=True, slots=True, eq=False)
class DistributionLayout(ModelLayout):
    """The outputs of one model: the scores and bins of all cells in one, or by stride, at the places `scores_at` and
    `bins_at` among the outputs."""

    classes: int
    bins: int
    strides: tuple[int, ...]
    centre: float
    scores_at: tuple[int, ...] = ()
    bins_at: tuple[int, ...] = ()

    def outputs(self, input_px: tuple[int, int]) -> tuple[Shape, ...]:
        """See `ModelLayout`."""
        return _shapes(self, input_px)

    def decode(
        self, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], thresholds: NDArray[np.float32]
    ) -> DetectionCandidates:
        """See `ModelLayout`; in the order of the network's cells."""
        if self.scores_at:
            scores = np.concatenate([outputs[i][0] for i in self.scores_at])
            logits = np.concatenate([outputs[i][0] for i in self.bins_at])
        else:
            scores, logits = np.split(outputs[0][0], [self.classes], axis=1)
        rows, class_ids, best = best_classes(scores, float(thresholds.min()))
        corners, sides = (part[rows] for part in cells(input_px, self.strides))
        distances = mean_bins(logits[rows].astype(np.float32), self.bins) * sides[:, None]
        centres = corners + np.float32(self.centre) * sides[:, None]
        boxes = np.concatenate([centres - distances[:, :2], centres + distances[:, 2:]], axis=1)
        # Upstream cuts boxes off at the input's border before NMS.
        boxes = np.clip(boxes, 0, np.array(input_px[::-1] * 2, np.float32))
        return candidates_above(boxes, best, class_ids, thresholds)


def mean_bins(logits: NDArray[np.float32], bins: int) -> NDArray[np.float32]:
    """The mean bin (N, 4) under the softmax of logits (N, 4 * bins), by side: left, top, right, bottom."""
    by_side = logits.reshape(len(logits), 4, bins)
    with np.errstate(invalid="ignore", over="ignore"):  # a broken network's numbers are sorted out later
        weights = np.exp(by_side - by_side.max(axis=2, keepdims=True))
        means: NDArray[np.float32] = weights @ np.arange(bins, dtype=np.float32) / weights.sum(axis=2)
    return means


def recognise(signature: Signature) -> DistributionLayout | str:
    """The layout of a model with such distributions, else what one of as many classes has."""
    input_px = signature.image_px()
    if len(signature.inputs) == 1 and input_px is not None:
        layout = _of_one_output(signature, input_px) or _of_many_outputs(signature, input_px)
        if layout is not None:
            return layout
    return f"[1, cells, {signature.classes} + 4 * bins], or both parts per stride"


def _of_one_output(signature: Signature, input_px: ImageSides) -> DistributionLayout | None:
    if len(signature.outputs) != 1 or len(signature.outputs[0].shape) != 3:
        return None
    for bins in _BINS:
        for strides in _STRIDES.values():
            shape = (1, count_of_cells(input_px, strides), signature.classes + 4 * bins)
            if signature.outputs[0].shape[2] is not None and fits(signature.outputs[0].shape, shape):
                return _layout(signature, input_px, bins, strides)
    return None


def _of_many_outputs(signature: Signature, input_px: ImageSides) -> DistributionLayout | None:
    shapes = [entry.shape for entry in signature.outputs if len(entry.shape) == 3]
    strides = _STRIDES.get(len(shapes) // 2)
    if strides is None or len(shapes) != len(signature.outputs):
        return None
    scores_at, bins_at = _places(shapes, signature.classes)
    columns = shapes[bins_at[0]][2] or 0
    if len(scores_at) != len(bins_at) or columns < 8:
        return None
    layout = _layout(signature, input_px, columns // 4, strides, scores_at, bins_at)
    return layout if all(map(fits, shapes, _shapes(layout, input_px))) else None


def _places(shapes: Sequence[Shape], classes: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Where the scores and the bins are among outputs of such shapes, by stride, the finest first."""
    # Where there are as many bins as classes, the scores come first.
    scores = [i for i, shape in enumerate(shapes) if shape[2] == classes][: len(shapes) // 2]
    finest_first = sorted(range(len(shapes)), key=lambda i: -(shapes[i][1] or 0))
    return tuple(i for i in finest_first if i in scores), tuple(i for i in finest_first if i not in scores)


def _layout(
    signature: Signature,
    input_px: ImageSides,
    bins: int,
    strides: tuple[int, ...],
    *places: tuple[int, ...],
) -> DistributionLayout:
    own, usual = signature.value("cell_centre"), _CENTRES[len(strides)]
    centre = float(own) if isinstance(own, int | float) else usual
    numbers = signature.classes, bins, strides, centre
    return DistributionLayout(input_px, max(strides), *numbers, *places, colours=_COLOURS, place=fit_top_left)


def _shapes(layout: DistributionLayout, input_px: ImageSides) -> tuple[Shape, ...]:
    if not layout.scores_at:
        return ((1, count_of_cells(input_px, layout.strides), layout.classes + 4 * layout.bins),)
    counts = [count_of_cells(input_px, (stride,)) for stride in layout.strides]
    shapes: dict[int, Shape] = {}
    for places, columns in ((layout.scores_at, layout.classes), (layout.bins_at, 4 * layout.bins)):
        shapes.update({place: (1, count, columns) for place, count in zip(places, counts, strict=True)})
    return tuple(shapes[place] for place in sorted(shapes))


FAMILY = Family("nanodet", "NanoDet", recognise, needs_nms=True)
