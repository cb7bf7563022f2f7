"""Which layouts are recognised, and decoding against plain loops, on random networks and on the stock model."""

import re
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.families.yolov5 import ANCHORS, AnchorLayout, Form, strides
from mcap_landmarks.vision.family import DetectionCandidates
from mcap_landmarks.vision.letterbox import Colours, fit, fitted_input, tensor
from mcap_landmarks.vision.nms import suppress
from mcap_landmarks.vision.onnx_session import open_session
from numpy.typing import NDArray

from tests.vision.networks import COCO_PARAMETERS, Export, answering, yolov5
from tests.vision.reference import decoded_boxes, greedy, head_rows

NAMES = ("person", "car", "dog", "suitcase")
METADATA = {"names": "['person', 'car']"}
THRESHOLDS = np.array([0.3, 0.5, 0.25, 0.4], np.float32)


def opened(path: Path, anchors: Literal["yolov5", "yolov7"] = "yolov5") -> Detector:
    return read_detector(open_session(path, threads=1), None, DetectConfig(anchors=anchors))


def layout(path: Path, anchors: Literal["yolov5", "yolov7"] = "yolov5") -> AnchorLayout:
    found = opened(path, anchors).layout
    assert isinstance(found, AnchorLayout)
    return found


def refusal(path: Path) -> str:
    with pytest.raises(ModelError) as error:
        opened(path)
    return str(error.value)


def rows(count: int = 252) -> np.ndarray:
    return np.zeros((1, count, 7), np.float32)


def noise(shape: tuple[int, ...], seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random(shape, dtype=np.float32)


def kept_rows(found: DetectionCandidates, iou: float = 0.45) -> NDArray[np.float32]:
    kept = found.take(suppress(found.boxes_xyxy, found.scores, found.class_ids, iou, 300))
    return np.column_stack([kept.boxes_xyxy, kept.scores, kept.class_ids])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sides", [(64, 96), ("h", "w")])
def test_a_decoded_output(tmp_path: Path, seed: int, sides: tuple[int, int]) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export(*sides, seed=seed))
    detector = opened(tmp_path / "m.onnx")
    outputs = detector.run(noise((1, 3, 64, 96), seed))
    found = kept_rows(detector.candidates(outputs, (64, 96), THRESHOLDS))
    plain = greedy(decoded_boxes(outputs[0][0], list(THRESHOLDS)), 0.45, 300)
    assert len(plain) > 10
    np.testing.assert_array_equal(found, np.array(plain, np.float32))


@pytest.mark.parametrize("form", ["heads", "planes"])
@pytest.mark.parametrize("sides", [(64, 96), ("h", "w")])
def test_raw_heads_are_decoded_as_the_network_would(tmp_path: Path, form: Form, sides: tuple[int, int]) -> None:
    yolov5(tmp_path / "raw.onnx", NAMES, export=Export(*sides, form=form, seed=4))
    yolov5(tmp_path / "decoded.onnx", NAMES, export=Export(*sides, seed=4))
    raw, decoded = (opened(tmp_path / f"{name}.onnx") for name in ("raw", "decoded"))
    image = noise((1, 3, 64, 96), 5)
    outputs = raw.run(image)
    found = raw.candidates(outputs, (64, 96), THRESHOLDS)
    wanted = decoded.candidates(decoded.run(image), (64, 96), THRESHOLDS)
    assert found.class_ids.tolist() == wanted.class_ids.tolist()
    np.testing.assert_allclose(found.boxes_xyxy, wanted.boxes_xyxy, rtol=1e-4, atol=1e-3)
    if form == "heads":
        rows = head_rows([output[0] for output in outputs], ANCHORS["yolov5"])
        plain = np.array(decoded_boxes(rows, list(THRESHOLDS)))
        np.testing.assert_allclose(found.boxes_xyxy, plain[:, :4], rtol=1e-4, atol=1e-3)
        np.testing.assert_allclose(found.scores, plain[:, 4], rtol=1e-5)


@pytest.mark.parametrize("export", [Export(64, 64, half=True), Export(64, 64, int8=True)])
def test_half_and_quantised_networks(tmp_path: Path, export: Export) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=export)
    detector = opened(tmp_path / "m.onnx")
    outputs = detector.run(noise((1, 3, 64, 64), 1).astype(detector.dtype))
    found = detector.candidates(outputs, (64, 64), THRESHOLDS)
    plain = decoded_boxes(outputs[0][0].astype(np.float32), list(THRESHOLDS))
    assert len(plain) > 20
    np.testing.assert_array_equal(found.scores, np.array([entry[4] for entry in plain], np.float32))


@pytest.mark.slow
def test_an_image_of_the_stock_model(shared_data: Path) -> None:
    detector = opened(shared_data / "models" / "yolov5n-coco.onnx")
    every = np.full(80, 0.01, np.float32)
    for name in ("dog", "person", "horses"):
        image = cv2.cvtColor(cv2.imread(str(shared_data / "photos" / f"{name}.jpg")), cv2.COLOR_BGR2RGB)
        box = fit(image.shape[:2], (640, 640))
        outputs = detector.run(tensor(image, box, (640, 640), detector.dtype, Colours()))
        found = kept_rows(detector.candidates(outputs, (640, 640), every))
        plain = greedy(decoded_boxes(outputs[0][0], list(every)), 0.45, 300)
        assert len(plain) >= 5
        np.testing.assert_array_equal(found, np.array(plain, np.float32))


def test_numbers_that_are_not_finite_are_no_boxes(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export(64, 64))
    rows = np.tile(np.array([9, 9, 4, 4, 1, 0, 0, 1, 0], np.float32), (252, 1))
    rows[0, 0], rows[1, 2], rows[2, 4], rows[3, 7], rows[4, 4] = np.inf, np.nan, np.nan, np.nan, np.inf
    rows[4, 7] = 0
    found = opened(tmp_path / "m.onnx").candidates([rows[None]], (64, 64), THRESHOLDS)
    assert len(found.scores) == 247
    assert np.isfinite(found.boxes_xyxy).all()


def test_outputs_of_another_shape_are_refused(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export("h", "w"))
    detector = opened(tmp_path / "m.onnx")
    for outputs in ([np.zeros((1, 84, 9), np.float32)], []):
        found = ", ".join(str(list(output.shape)) for output in outputs)
        words = f"outputs are {found}, but a detector of 4 classes (YOLOv5 or YOLOv7) gives [1, 252, 9]"
        with pytest.raises(ModelError, match=re.escape(words)):
            detector.candidates(outputs, (64, 64), THRESHOLDS)


def test_fitted_inputs_are_what_a_free_network_takes(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export("h", "w"))
    detector = opened(tmp_path / "m.onnx")
    size = fitted_input((75, 100), 96, detector.layout.stride_px)
    assert size == (96, 96)
    assert detector.run(noise((1, 3, *size), 0))[0].shape == detector.layout.outputs(size)[0]


@pytest.mark.parametrize("size", ["n", "s"])
def test_the_tests_own_networks_are_those_of_yolov5(tmp_path: Path, size: str) -> None:
    names = [f"class {i}" for i in range(80)]
    assert yolov5(tmp_path / "m.onnx", names, size, Export(64, 64)) == COCO_PARAMETERS[size]


def test_layouts(tmp_path: Path) -> None:
    for form in ("decoded", "heads", "planes"):
        yolov5(tmp_path / "m.onnx", ["a", "b"], export=Export(64, 64, form=form))
        assert layout(tmp_path / "m.onnx").form == form
    old = {"output": rows(), **{f"head{i}": np.zeros((1, 3, 8 >> i, 8 >> i, 7), np.float32) for i in range(3)}}
    assert layout(answering(tmp_path / "old.onnx", old, METADATA)).form == "decoded"
    wide = answering(tmp_path / "p6.onnx", {"output0": rows(255)}, {**METADATA, "stride": "64"})
    assert strides(layout(wide).stride_px) == (8, 16, 32, 64)


def test_anchors_of_raw_heads(tmp_path: Path) -> None:
    heads = {f"head{i}": np.zeros((1, 3, 8 >> i, 8 >> i, 7), np.float32) for i in range(3)}
    path = answering(tmp_path / "a.onnx", heads, METADATA)
    assert layout(path).anchors[0, 0].tolist() == [10, 13]
    assert layout(path, anchors="yolov7").anchors[0, 0].tolist() == [12, 16]
    own = answering(tmp_path / "b.onnx", heads, {**METADATA, "anchors": str(list(range(1, 19)))})
    assert layout(own).anchors[2, 2].tolist() == [17, 18]
    poor = answering(tmp_path / "c.onnx", heads, {**METADATA, "anchors": "[1, 2, 3, 4, 5, 6]"})
    assert "1 heads have anchors" in refusal(poor)
    bad = answering(tmp_path / "d.onnx", heads, {**METADATA, "anchors": "['x']"})
    assert "not heads x 3 x 2" in refusal(bad)
