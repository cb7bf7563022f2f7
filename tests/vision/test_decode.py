"""Decoding against plain loops, on random networks and on the stock model."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.contract import ANCHORS, read_contract
from mcap_landmarks.vision.decode import Candidates, candidates
from mcap_landmarks.vision.letterbox import fit, fitted_input, tensor
from mcap_landmarks.vision.nms import suppress
from mcap_landmarks.vision.session import open_session
from numpy.typing import NDArray

from tests.vision.networks import Export, Form, yolov5
from tests.vision.reference import decoded_boxes, greedy, head_rows

NAMES = ("person", "car", "dog", "suitcase")
THRESHOLDS = np.array([0.3, 0.5, 0.25, 0.4], np.float32)


def noise(shape: tuple[int, ...], seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random(shape, dtype=np.float32)


def kept_rows(found: Candidates, iou: float = 0.45) -> NDArray[np.float32]:
    kept = found.take(suppress(found.boxes_xyxy, found.scores, found.class_ids, iou, 300))
    return np.column_stack([kept.boxes_xyxy, kept.scores, kept.class_ids])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sides", [(64, 96), ("h", "w")])
def test_a_decoded_output(tmp_path: Path, seed: int, sides: tuple[int, int]) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export(*sides, seed=seed))
    session = open_session(tmp_path / "m.onnx", threads=1)
    contract = read_contract(session, None, "yolov5")
    outputs = session.run(noise((1, 3, 64, 96), seed))
    found = kept_rows(candidates(outputs, contract, (64, 96), THRESHOLDS))
    plain = greedy(decoded_boxes(outputs[0][0], list(THRESHOLDS)), 0.45, 300)
    assert len(plain) > 10
    np.testing.assert_array_equal(found, np.array(plain, np.float32))


@pytest.mark.parametrize("form", ["heads", "planes"])
@pytest.mark.parametrize("sides", [(64, 96), ("h", "w")])
def test_raw_heads_are_decoded_as_the_network_would(tmp_path: Path, form: Form, sides: tuple[int, int]) -> None:
    yolov5(tmp_path / "raw.onnx", NAMES, export=Export(*sides, form=form, seed=4))
    yolov5(tmp_path / "decoded.onnx", NAMES, export=Export(*sides, seed=4))
    raw, decoded = (open_session(tmp_path / f"{name}.onnx", threads=1) for name in ("raw", "decoded"))
    image = noise((1, 3, 64, 96), 5)
    outputs = raw.run(image)
    found = candidates(outputs, read_contract(raw, None, "yolov5"), (64, 96), THRESHOLDS)
    wanted = candidates(decoded.run(image), read_contract(decoded, None, "yolov5"), (64, 96), THRESHOLDS)
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
    session = open_session(tmp_path / "m.onnx", threads=1)
    contract = read_contract(session, None, "yolov5")
    outputs = session.run(noise((1, 3, 64, 64), 1).astype(contract.dtype))
    found = candidates(outputs, contract, (64, 64), THRESHOLDS)
    plain = decoded_boxes(outputs[0][0].astype(np.float32), list(THRESHOLDS))
    assert len(plain) > 20
    np.testing.assert_array_equal(found.scores, np.array([entry[4] for entry in plain], np.float32))


def test_an_image_of_the_stock_model(shared_data: Path) -> None:
    session = open_session(shared_data / "models" / "yolov5n-coco.onnx", threads=1)
    contract = read_contract(session, None, "yolov5")
    every = np.full(80, 0.01, np.float32)
    for name in ("dog", "person", "horses"):
        image = cv2.cvtColor(cv2.imread(str(shared_data / "photos" / f"{name}.jpg")), cv2.COLOR_BGR2RGB)
        outputs = session.run(tensor(image, fit(image.shape[:2], (640, 640)), (640, 640), contract.dtype))
        found = kept_rows(candidates(outputs, contract, (640, 640), every))
        plain = greedy(decoded_boxes(outputs[0][0], list(every)), 0.45, 300)
        assert len(plain) >= 5
        np.testing.assert_array_equal(found, np.array(plain, np.float32))


def test_numbers_that_are_not_finite_are_no_boxes(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export(64, 64))
    contract = read_contract(open_session(tmp_path / "m.onnx", threads=1), None, "yolov5")
    rows = np.tile(np.array([9, 9, 4, 4, 1, 0, 0, 1, 0], np.float32), (252, 1))
    rows[0, 0], rows[1, 2], rows[2, 4], rows[3, 7], rows[4, 4] = np.inf, np.nan, np.nan, np.nan, np.inf
    rows[4, 7] = 0
    found = candidates([rows[None]], contract, (64, 64), THRESHOLDS)
    assert len(found.scores) == 247
    assert np.isfinite(found.boxes_xyxy).all()


def test_outputs_of_another_shape_are_refused(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export("h", "w"))
    contract = read_contract(open_session(tmp_path / "m.onnx", threads=1), None, "yolov5")
    with pytest.raises(ModelError, match=r"outputs are \[1, 84, 9\].* gives \[1, 252, 9\]"):
        candidates([np.zeros((1, 84, 9), np.float32)], contract, (64, 64), THRESHOLDS)


def test_fitted_inputs_are_what_a_free_network_takes(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", NAMES, export=Export("h", "w"))
    session = open_session(tmp_path / "m.onnx", threads=1)
    contract = read_contract(session, None, "yolov5")
    size = fitted_input((75, 100), 96, contract.stride_px)
    assert size == (96, 96)
    assert session.run(noise((1, 3, *size), 0))[0].shape == contract.expected(size)[0]
