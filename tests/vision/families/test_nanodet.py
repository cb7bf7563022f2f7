"""NanoDet: which outputs are recognised, and decoding against plain loops written from its definition."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import find, prepare
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.families.nanodet import DistributionLayout
from mcap_landmarks.vision.onnx_session import open_session
from numpy.typing import NDArray

from tests.vision.networks import Side, answering
from tests.vision.reference import Box

METADATA = {"names": "['person', 'car', 'dog']"}
INPUT_PX = (72, 104)
"""Not in whole strides of 32: the coarsest cells reach over the border."""
THRESHOLDS = np.array([0.3, 0.5, 0.4], np.float32)


def cells_of(stride: int) -> int:
    return math.ceil(INPUT_PX[0] / stride) * math.ceil(INPUT_PX[1] / stride)


def tables(strides: Sequence[int], bins: int, seed: int = 0) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Scores and bins of every stride."""
    rng = np.random.default_rng(seed)
    shapes = [cells_of(stride) for stride in strides]
    scores = [rng.uniform(0, 0.6, (1, count, 3)).astype(np.float32) for count in shapes]
    logits = [rng.normal(0, 3, (1, count, 4 * bins)).astype(np.float32) for count in shapes]
    return list(zip(scores, logits, strict=True))


def plain(content: Sequence[tuple[NDArray[Any], NDArray[Any]]], strides: Sequence[int], centre: float) -> list[Box]:
    """One cell after the other."""
    found: list[Box] = []
    for stride, (scores, logits) in zip(strides, content, strict=True):
        columns = math.ceil(INPUT_PX[1] / stride)
        for cell, row in enumerate(scores[0]):
            best = max(range(len(row)), key=lambda i: row[i])
            if row[best] <= THRESHOLDS[best]:
                continue
            sides = []
            for side in np.split(logits[0, cell].astype(np.float64), 4):
                weights = [math.exp(logit) for logit in side]
                sides.append(stride * sum(i * weight for i, weight in enumerate(weights)) / sum(weights))
            x, y = (cell % columns + centre) * stride, (cell // columns + centre) * stride
            right, bottom = min(x + sides[2], INPUT_PX[1]), min(y + sides[3], INPUT_PX[0])
            found.append((max(x - sides[0], 0), max(y - sides[1], 0), right, bottom, row[best], best))
    return found


def opened(
    folder: Path,
    outputs: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, str] = METADATA,
    sides: Sequence[Side] = INPUT_PX,
) -> Detector:
    path = answering(folder / "m.onnx", outputs, metadata, (1, 3, *sides))
    return read_detector(open_session(path, threads=1), None, DetectConfig())


def by_stride(content: Sequence[tuple[NDArray[Any], NDArray[Any]]], order: Sequence[int]) -> dict[str, NDArray[Any]]:
    flat = [scores for scores, _ in content] + [logits for _, logits in content]
    return {f"output{i}": flat[i] for i in order}


def assert_equal_to_plain(detector: Detector, wanted: Sequence[Box]) -> None:
    outputs = detector.run(np.zeros((1, 3, *INPUT_PX), np.float32))
    found = detector.candidates(outputs, INPUT_PX, THRESHOLDS)
    assert len(wanted) > 20
    assert found.class_ids.tolist() == [box[5] for box in wanted]
    np.testing.assert_array_equal(found.scores, np.array([box[4] for box in wanted], np.float32))
    np.testing.assert_allclose(found.boxes_xyxy, np.array([box[:4] for box in wanted]), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize(("strides", "bins", "centre"), [((8, 16, 32), 11, 0.5), ((8, 16, 32, 64), 8, 0.0)])
def test_scores_and_bins_in_one_output(tmp_path: Path, strides: tuple[int, ...], bins: int, centre: float) -> None:
    content = tables(strides, bins)
    joined = np.concatenate([np.concatenate(pair, axis=2) for pair in content], axis=1)
    detector = opened(tmp_path, {"output": joined})
    assert detector.family.name == "nanodet"
    assert_equal_to_plain(detector, plain(content, strides, centre))


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (5, 4, 3, 2, 1, 0), (0, 3, 1, 4, 2, 5)])
def test_scores_and_bins_by_stride_in_any_order(tmp_path: Path, order: tuple[int, ...]) -> None:
    content = tables((8, 16, 32), 11)
    assert_equal_to_plain(opened(tmp_path, by_stride(content, order)), plain(content, (8, 16, 32), 0.5))


def test_scores_come_first_where_there_are_as_many_bins(tmp_path: Path) -> None:
    names = {"names": str([f"class {i}" for i in range(44)])}
    zeros = [np.zeros((1, cells_of(stride), 44), np.float32) for stride in (8, 16, 32)]
    layout = opened(tmp_path, {f"output{i}": zeros[i % 3] for i in range(6)}, names).layout
    assert isinstance(layout, DistributionLayout)
    assert (layout.scores_at, layout.bins_at, layout.bins) == ((0, 1, 2), (3, 4, 5), 11)


def test_metadata_may_say_where_cells_are_measured_from(tmp_path: Path) -> None:
    content = tables((8, 16, 32), 8)
    detector = opened(tmp_path, by_stride(content, range(6)), {**METADATA, "cell_centre": "0"})
    assert_equal_to_plain(detector, plain(content, (8, 16, 32), 0.0))


def test_free_sides(tmp_path: Path) -> None:
    content = tables((8, 16, 32), 11)
    detector = opened(tmp_path, by_stride(content, range(6)), sides=("h", "w"))
    assert detector.layout.input_px == (None, None)
    assert_equal_to_plain(detector, plain(content, (8, 16, 32), 0.5))


def test_a_box_comes_back_to_the_image(tmp_path: Path) -> None:
    """The image is at the top left, in margins of black, blue first, less the mean of the training set."""
    content = tables((8, 16, 32), 11)
    for scores, logits in content:
        scores[:], logits[:] = 0, 0
    content[1][0][0, 2 * 7 + 3, 1] = 0.9  # the cell around (56, 40)
    content[1][1][0, 2 * 7 + 3, [0, 11 + 1, 22 + 2, 33 + 0]] = 50  # left 0, top 1, right 2, bottom 0 strides
    detector = opened(tmp_path, by_stride(content, range(6)))
    config = DetectConfig()
    (image,) = prepare(np.full((144, 416, 3), (10, 20, 30), np.uint8), detector, config)
    outside = -np.array([103.53, 116.28, 123.675]) / [57.375, 57.12, 58.395]
    np.testing.assert_allclose(image.array[0, :, -1, -1], outside, rtol=1e-5)
    inside = (np.array([30, 20, 10]) - [103.53, 116.28, 123.675]) / [57.375, 57.12, 58.395]
    np.testing.assert_allclose(image.array[0, :, 35, -1], inside, rtol=1e-5)
    found = find([detector.run(image.array)], [image], detector, THRESHOLDS, config)
    np.testing.assert_allclose(found.boxes_xyxy, [[56 * 4, 24 * 4, 88 * 4, 36 * 4]])
    assert (found.class_ids.tolist(), found.scores.tolist()) == ([1], [np.float32(0.9)])
