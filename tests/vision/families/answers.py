"""Detectors whose networks give known answers, as the tests of the families open and judge them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import Found, find, prepare
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.onnx_session import open_session
from numpy.typing import NDArray

from tests.vision.networks import Side, answering
from tests.vision.reference import Box

METADATA = {"names": "['person', 'car', 'dog']"}
INPUT_PX = (64, 96)
THRESHOLDS = np.array([0.3, 0.5, 0.4], np.float32)
CELLS = 96 + 24 + 6
"""Of strides 8, 16 and 32 in such an input."""


def opened(
    folder: Path,
    outputs: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, str] = METADATA,
    sides: Sequence[Side] = INPUT_PX,
    sized: str = "",
) -> Detector:
    """The detector that always gives these outputs."""
    path = answering(folder / "m.onnx", outputs, metadata, (1, 3, *sides), sized=sized)
    return read_detector(open_session(path, threads=1), None, DetectConfig())


def assert_equal_to_plain(detector: Detector, wanted: Sequence[Box], input_px: tuple[int, int] = INPUT_PX) -> None:
    """Its candidates are these boxes, in their order."""
    outputs = detector.run(np.zeros((1, 3, *input_px), detector.dtype))
    found = detector.candidates(outputs, input_px, THRESHOLDS)
    assert len(wanted) > 20
    assert found.class_ids.tolist() == [box[5] for box in wanted]
    np.testing.assert_allclose(found.scores, np.array([box[4] for box in wanted], np.float32), rtol=1e-6)
    np.testing.assert_allclose(found.boxes_xyxy, np.array([box[:4] for box in wanted]), rtol=1e-5, atol=1e-3)


def found_in(detector: Detector, image_px: tuple[int, int], rgb: tuple[int, int, int] = (10, 20, 30)) -> Found:
    """What it finds in an image (height, width) of one colour."""
    config = DetectConfig()
    prepared = prepare(np.full((*image_px, 3), rgb, np.uint8), detector, config)
    return find([detector.run(part.array) for part in prepared], prepared, detector, THRESHOLDS, config)


def corners(x: float, y: float, width: float, height: float) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of a box by centre and size."""
    return x - width / 2, y - height / 2, x + width / 2, y + height / 2


def best(scores: Sequence[float]) -> int | None:
    """The class of the best score, None where it is not above its threshold."""
    top = max(range(len(scores)), key=lambda i: scores[i])
    return top if scores[top] > THRESHOLDS[top] else None
