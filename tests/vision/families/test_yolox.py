"""YOLOX: which outputs are recognised, how images are fed, and decoding against plain loops."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import prepare
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session
from numpy.typing import NDArray

from tests.vision.families.answers import (
    CELLS,
    INPUT_PX,
    METADATA,
    THRESHOLDS,
    assert_equal_to_plain,
    corners,
    found_in,
    opened,
)
from tests.vision.networks import answering
from tests.vision.reference import Box


def head() -> NDArray[np.float32]:
    rng = np.random.default_rng(2)
    parts = rng.normal(0.5, 0.5, (1, CELLS, 2)), rng.normal(0, 1, (1, CELLS, 2)), rng.uniform(0, 1, (1, CELLS, 4))
    return np.concatenate(parts, axis=2).astype(np.float32)


def plain(output: NDArray[np.float32]) -> list[Box]:
    """One cell after the other, in the order of the network."""
    grid = [(s, u, v) for s in (8, 16, 32) for v in range(INPUT_PX[0] // s) for u in range(INPUT_PX[1] // s)]
    found: list[Box] = []
    for (stride, u, v), row in zip(grid, output[0], strict=True):
        top = max(range(3), key=lambda i: row[5 + i])
        score = row[4] * row[5 + top]
        if row[4] > THRESHOLDS.min() and score > THRESHOLDS[top]:
            size = math.exp(row[2]) * stride, math.exp(row[3]) * stride
            found.append((*corners((u + row[0]) * stride, (v + row[1]) * stride, *size), score, top))
    return found


def test_cells_are_decoded(tmp_path: Path) -> None:
    output = head()
    detector = opened(tmp_path, {"output": output})
    assert detector.family.name == "yolox"
    assert_equal_to_plain(detector, plain(output))


def test_images_are_fed_as_they_are_blue_first_at_the_top_left(tmp_path: Path) -> None:
    output = np.zeros((1, CELLS, 8), np.float32)
    output[0, 96 + 6 + 2] = 0.5, 0.25, math.log(2), 0, 0.9, 0.8, 0, 0  # centre (40, 20), 32 x 16
    detector = opened(tmp_path, {"output": output})
    array = prepare(np.full((480, 960, 3), (10, 20, 30), np.uint8), detector, DetectConfig())[0].array
    assert array[0, :, 47, 95].tolist() == [30, 20, 10]
    assert array[0, :, 48, 0].tolist() == [114, 114, 114]
    found = found_in(detector, (480, 960))
    np.testing.assert_allclose(found.boxes_xyxy, [[240, 120, 560, 280]], rtol=1e-6)


def test_free_sides_are_told_from_yolov5_by_choice(tmp_path: Path) -> None:
    """Its output has the columns of YOLOv5's, whose exporter writes the stride into the metadata."""
    path = answering(tmp_path / "m.onnx", {"output": head()}, METADATA, (1, 3, "h", "w"))
    session = open_session(path, threads=1)
    with pytest.raises(UsageError, match=re.escape("yolov5 (YOLOv5 or YOLOv7) or yolox (YOLOX); choose with")):
        read_detector(session, None, DetectConfig())
    assert read_detector(session, None, DetectConfig(family="yolox")).family.name == "yolox"
    assert opened(tmp_path, {"output": head()}, {**METADATA, "family": "yolox"}, ("h", "w")).family.name == "yolox"
