"""Which files are taken for detectors, what their metadata say, and what is said about the others."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.metadata import stated_family
from mcap_landmarks.vision.onnx_session import open_session

from tests.vision.networks import Export, answering, yolov5

NAMES = {"names": "['person', 'car']"}


def rows(count: int = 252, columns: int = 7) -> np.ndarray:
    return np.zeros((1, count, columns), np.float32)


def detector(path: Path, names: Path | None = None, family: str | None = None) -> Detector:
    return read_detector(open_session(path, threads=1), names, DetectConfig(family=family))


def refusal(path: Path, names: Path | None = None) -> str:
    with pytest.raises(ModelError) as error:
        detector(path, names)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_the_stock_model(shared_data: Path) -> None:
    found = detector(shared_data / "models" / "yolov5n-coco.onnx")
    assert (len(found.names), found.names[0], found.names[79]) == (80, "person", "toothbrush")
    assert (found.layout.stride_px, found.layout.input_px, found.dtype) == (32, (640, 640), np.float32)
    assert found.confidence == {}


def test_free_and_fixed_sides(tmp_path: Path) -> None:
    for sides, expected in (((64, 96), (64, 96)), (("h", "w"), (None, None)), ((64, "w"), (64, None))):
        yolov5(tmp_path / "m.onnx", ["a"], export=Export(*sides))
        assert detector(tmp_path / "m.onnx").layout.input_px == expected


def test_metadata(tmp_path: Path) -> None:
    content = {"output0": rows()}
    listed = answering(tmp_path / "a.onnx", content, {"names": '["person", "car"]', "stride": "[8, 16, 32]"})
    assert detector(listed).names == ("person", "car")
    keyed = answering(tmp_path / "b.onnx", content, {"names": "{1: 'car', 0: 'person'}", "confidence": "0.6"})
    assert detector(keyed).names == ("person", "car")
    assert detector(keyed).confidence == {"person": 0.6, "car": 0.6}
    single = answering(tmp_path / "c.onnx", content, {**NAMES, "confidence": '{"car": 0.7}'})
    assert detector(single).confidence == {"car": 0.7}


def test_names_from_a_file(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": rows()})
    assert "--names FILE" in refusal(path)
    names = tmp_path / "names.txt"
    names.write_text("person\nfire hydrant\n\n")
    assert detector(path, names).names == ("person", "fire hydrant")
    names.write_text("person\n")
    assert "1 classes" in refusal(path, names)
    assert "not a text file" in refusal(path, tmp_path / "missing.txt")


def test_other_networks_are_refused_with_their_shapes(tmp_path: Path) -> None:
    other = answering(tmp_path / "other.onnx", {"output0": np.zeros((1, 1000), np.float32)}, NAMES)
    line = refusal(other)
    assert "found input images [1, 3, 64, 64] float and output output0 [1, 1000] float" in line
    assert "[1, 252, 7] or raw heads (YOLOv5 or YOLOv7); [1, 6, 84] (YOLOv8 to 12); [1, 84, 7] (YOLOX)" in line
    assert "yolo export model=FILE.pt format=onnx" in line
    masks = {"output0": rows(252, 39), "output1": np.zeros((1, 32, 16, 16), np.float32)}
    assert "output1 [1, 32, 16, 16]" in refusal(answering(tmp_path / "seg.onnx", masks, NAMES))
    pose = answering(tmp_path / "pose.onnx", {"output0": np.zeros((1, 56, 84), np.float32)}, NAMES)
    assert "[1, 56, 84]" in refusal(pose)
    grey = answering(tmp_path / "grey.onnx", {"output0": rows()}, NAMES, (1, 1, 64, 64))
    assert "found input images [1, 1, 64, 64]" in refusal(grey)
    assert "expected an input [1, 3, ?, ?] float or float16; export" in refusal(grey)
    batch = answering(tmp_path / "batch.onnx", {"output0": rows()}, NAMES, (4, 3, 64, 64))
    assert "[4, 3, 64, 64]" in refusal(batch)
    odd = answering(tmp_path / "odd.onnx", {"output0": rows()}, NAMES, (1, 3, 60, 64))
    assert "multiples of 32" in refusal(odd)
    two = answering(tmp_path / "two.onnx", {"output0": rows()}, NAMES, inputs=("images", "scale"))
    assert "scale" in refusal(two)


def test_metadata_that_make_no_sense(tmp_path: Path) -> None:
    for metadata, said in (
        ({"names": "{0: 1}"}, "names in its metadata cannot be read"),
        ({"names": "7"}, "names in its metadata cannot be read"),
        ({"names": "{person"}, "names in the metadata is '{person'"),
        ({**NAMES, "stride": "16"}, "stride 16"),
        ({**NAMES, "confidence": "2"}, "confidence in its metadata"),
        ({**NAMES, "confidence": "{'dog': 0.5}"}, "confidence in its metadata"),
    ):
        assert said in refusal(answering(tmp_path / "m.onnx", {"output0": rows()}, metadata))


def test_the_metadata_may_name_the_family() -> None:
    for metadata, stated in (
        ({}, None),
        ({"names": "['a']", "stride": "32"}, None),
        ({"family": "nanodet", "description": "Ultralytics YOLO11n model"}, "nanodet"),
        ({"description": "Ultralytics YOLO11n model", "head": "Detect", "end2end": "False"}, "yolov8"),
        ({"description": "Ultralytics YOLO11n model", "args": "{'batch': 1, 'nms': True}"}, "nms_in_graph"),
        ({"description": "Ultralytics YOLO26n model", "end2end": "True"}, "nms_in_graph"),
        ({"description": "Ultralytics YOLOv10n model trained on coco"}, "nms_in_graph"),
        ({"description": "Ultralytics YOLOv10n model", "end2end": "False"}, "yolov8"),
        ({"description": "Ultralytics rtdetr-l model", "end2end": "False"}, "detr"),
    ):
        assert stated_family(metadata) == stated


def test_a_family_that_the_metadata_name_is_the_only_one(tmp_path: Path) -> None:
    six = {"output0": np.zeros((1, 300, 6), np.float32)}
    assert detector(answering(tmp_path / "a.onnx", six, {**NAMES, "family": "detr"})).family.name == "detr"
    line = refusal(answering(tmp_path / "b.onnx", six, {**NAMES, "family": "yolov8"}))
    assert "expected [1, 6, 84] (YOLOv8 to 12); export" in line
    unknown = answering(tmp_path / "c.onnx", {"output0": rows()}, {**NAMES, "family": "YOLO"})
    assert detector(unknown).family.name == "yolov5"


def test_a_family_that_does_not_exist(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES)
    assert detector(path, family="yolov5").family.name == "yolov5"
    with pytest.raises(UsageError, match=r"detect\.family = yolo5: there is no such family .* there are .*yolov5"):
        detector(path, family="yolo5")
