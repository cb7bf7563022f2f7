"""A further family is one file: its models are recognised, fed and decoded, and no other line changes."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS
from mcap_landmarks.config import stage_config
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import Image
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages.detect import process
from mcap_landmarks.vision import families
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import prepare
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.onnx_session import open_session

from tests.vision.networks import answering

TOY = '''
"""Boxes with their score and class, as shares of an image that is stretched; NMS is done."""

import numpy as np
from mcap_landmarks.vision.family import DetectionCandidates, Family, ModelLayout
from mcap_landmarks.vision.letterbox import Colours, stretched
from mcap_landmarks.vision.onnx_session import fits


class Ended(ModelLayout):
    def outputs(self, input_px):
        return ((1, None, 6),)

    def decode(self, outputs, input_px, thresholds):
        rows = outputs[0][0].astype(np.float32)
        classes = rows[:, 5].astype(np.intp)
        rows, classes = (part[rows[:, 4] > thresholds[classes]] for part in (rows, classes))
        return DetectionCandidates(rows[:, :4] * np.array(input_px[::-1] * 2, np.float32), rows[:, 4], classes)


def recognise(signature):
    if len(signature.outputs) == 1 and fits(signature.outputs[0].shape, (1, None, 6)):
        height, width = signature.inputs[0].shape[2:]
        size = {"size": np.zeros((1, 3, 64, 64), np.float32)}
        colours = Colours("bgr", (10, 20, 30), (1, 2, 4))
        return Ended((height, width), 1, constants=size, colours=colours, place=stretched)
    return "[1, ?, 6]"


FAMILY = Family("toy", "Toy", recognise, needs_nms=False)
'''
NAMES = {"names": "['person', 'car']", "stride": "32"}
ROWS = np.array([[[0.5, 0, 1, 0.5, 0.4, 0], [0.5, 0, 1, 0.5, 0.9, 0], [0, 0, 0.5, 0.5, 0.6, 1]]], np.float32)


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model of a family whose one file lies in the folder of families."""
    folder = tmp_path / "families"
    folder.mkdir()
    (folder / "toy.py").write_text(TOY.lstrip())
    monkeypatch.setattr(families, "__path__", [*families.__path__, str(folder)])
    return answering(tmp_path / "toy.onnx", {"output": ROWS}, NAMES, inputs=("images", "size"))


def detector(path: Path, family: str | None = None) -> Detector:
    return read_detector(open_session(path, threads=1), None, DetectConfig(family=family))


def test_its_models_are_found_and_detect(toy: Path) -> None:
    image = Image(1, "camera", 32, 128, "mono8", False, 128, bytes(32 * 128))
    config = stage_config(DetectConfig, "detect", {"threads": 1})
    first, *_ = process([Bundle(1, 1, {CAMERA_IMAGE: image})], config, {"model": toy})
    assert isinstance(first, Stamped)
    assert isinstance(first.message, Detections)
    assert first.channel == DETECTIONS
    assert first.message.boxes_xyxy.tolist() == [[64, 0, 128, 16], [0, 0, 64, 16], [64, 0, 128, 16]]
    found = [(name, round(score, 6)) for ((name, score),) in first.message.hypotheses]
    assert found == [("person", 0.9), ("car", 0.6), ("person", 0.4)]


def test_it_says_how_images_are_fed(toy: Path) -> None:
    rgb = np.tile(np.array([50, 40, 30], np.uint8), (32, 128, 1))
    array = prepare(rgb, detector(toy), DetectConfig())[0].array
    assert [np.unique(plane).tolist() for plane in array[0]] == [[20], [10], [5]]


def test_what_no_family_knows_is_told_what_each_expects(toy: Path, tmp_path: Path) -> None:
    del toy
    strange = answering(tmp_path / "strange.onnx", {"output": np.zeros((1, 5), np.float32)}, NAMES)
    with pytest.raises(ModelError, match=r"found .*output \[1, 5\] float; expected .*; \[1, \?, 6\] \(Toy\); "):
        detector(strange)
    with pytest.raises(ModelError, match=r"expected \[1, \?, 6\] \(Toy\); export"):
        detector(strange, family="toy")


def test_what_two_families_know_needs_a_choice(toy: Path, tmp_path: Path) -> None:
    del toy
    one = {"names": "['person']"}
    both = answering(tmp_path / "both.onnx", {"output": np.zeros((1, 252, 6), np.float32)}, one)
    with pytest.raises(UsageError, match=r"family toy \(Toy\) or yolov5 .*; choose with --set detect.family=NAME"):
        detector(both)
    assert detector(both, family="yolov5").family.name == "yolov5"
    assert detector(both, family="toy").family.name == "toy"
