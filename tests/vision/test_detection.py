"""One image through a detector: sizes of the input and thresholds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.config import stage_config
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import input_size, thresholds
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session

from tests.vision.networks import Export, yolov5


@pytest.mark.slow
def test_input_sizes(tmp_path: Path) -> None:
    def size(sides: tuple[Any, Any], image: tuple[int, int], **settings: object) -> tuple[int, int]:
        yolov5(tmp_path / "m.onnx", ["a"], export=Export(*sides))
        detector = read_detector(open_session(tmp_path / "m.onnx", threads=1), None, DetectConfig())
        return input_size(detector, image, stage_config(DetectConfig, "detect", settings))

    assert size(("h", "w"), (480, 640)) == (480, 640)
    assert size(("h", "w"), (480, 640), shape="square") == (640, 640)
    assert size(("h", "w"), (480, 640), size_px=320) == (256, 320)
    assert size(("h", "w"), (480, 640), size_px=330, shape="square") == (352, 352)
    assert size((64, 96), (480, 640)) == (64, 96)
    assert size((480, "w"), (480, 640)) == (480, 640)


def test_what_is_not_asked_for_has_no_threshold(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", ["person", "car", "dog"], export=Export(64, 64))
    detector = read_detector(open_session(tmp_path / "m.onnx", threads=1), None, DetectConfig())
    assert thresholds(detector, DetectConfig(classes=("car",))).tolist() == [np.inf, 0.25, np.inf]
