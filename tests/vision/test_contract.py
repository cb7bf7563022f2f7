"""Which files are taken for YOLOv5 detectors, and what is said about the others."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.vision.contract import Contract, read_contract
from mcap_landmarks.vision.session import open_session

from tests.vision.networks import COCO_PARAMETERS, Export, answering, yolov5

NAMES = {"names": "['person', 'car']"}


def rows(count: int = 252, columns: int = 7) -> np.ndarray:
    return np.zeros((1, count, columns), np.float32)


def contract(path: Path, names: Path | None = None, anchors: str = "yolov5") -> Contract:
    return read_contract(open_session(path, threads=1), names, anchors)


def refusal(path: Path, names: Path | None = None) -> str:
    with pytest.raises(ModelError) as error:
        contract(path, names)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("size", ["n", "s"])
def test_the_tests_own_networks_are_those_of_yolov5(tmp_path: Path, size: str) -> None:
    names = [f"class {i}" for i in range(80)]
    assert yolov5(tmp_path / "m.onnx", names, size, Export(64, 64)) == COCO_PARAMETERS[size]


def test_the_stock_model(shared_data: Path) -> None:
    found = contract(shared_data / "models" / "yolov5n-coco.onnx")
    assert (len(found.names), found.names[0], found.names[79]) == (80, "person", "toothbrush")
    assert (found.stride_px, found.input_px, found.layout, found.dtype) == (32, (640, 640), "decoded", np.float32)
    assert found.confidence == {}


def test_free_and_fixed_sides(tmp_path: Path) -> None:
    for sides, expected in (((64, 96), (64, 96)), (("h", "w"), (None, None)), ((64, "w"), (64, None))):
        yolov5(tmp_path / "m.onnx", ["a"], export=Export(*sides))
        assert contract(tmp_path / "m.onnx").input_px == expected


def test_layouts(tmp_path: Path) -> None:
    for form in ("decoded", "heads", "planes"):
        yolov5(tmp_path / "m.onnx", ["a", "b"], export=Export(64, 64, form=form))
        assert contract(tmp_path / "m.onnx").layout == form
    old = {"output": rows(), **{f"head{i}": np.zeros((1, 3, 8 >> i, 8 >> i, 7), np.float32) for i in range(3)}}
    assert contract(answering(tmp_path / "old.onnx", old, NAMES)).layout == "decoded"
    wide = answering(tmp_path / "p6.onnx", {"output0": rows(255)}, {**NAMES, "stride": "64"})
    assert contract(wide).strides_px == (8, 16, 32, 64)


def test_metadata(tmp_path: Path) -> None:
    content = {"output0": rows()}
    listed = answering(tmp_path / "a.onnx", content, {"names": '["person", "car"]', "stride": "[8, 16, 32]"})
    assert contract(listed).names == ("person", "car")
    keyed = answering(tmp_path / "b.onnx", content, {"names": "{1: 'car', 0: 'person'}", "confidence": "0.6"})
    assert contract(keyed).names == ("person", "car")
    assert contract(keyed).confidence == {"person": 0.6, "car": 0.6}
    single = answering(tmp_path / "c.onnx", content, {**NAMES, "confidence": '{"car": 0.7}'})
    assert contract(single).confidence == {"car": 0.7}


def test_anchors_of_raw_heads(tmp_path: Path) -> None:
    heads = {f"head{i}": np.zeros((1, 3, 8 >> i, 8 >> i, 7), np.float32) for i in range(3)}
    path = answering(tmp_path / "a.onnx", heads, NAMES)
    assert contract(path).anchors[0, 0].tolist() == [10, 13]
    assert contract(path, anchors="yolov7").anchors[0, 0].tolist() == [12, 16]
    own = answering(tmp_path / "b.onnx", heads, {**NAMES, "anchors": str(list(range(1, 19)))})
    assert contract(own).anchors[2, 2].tolist() == [17, 18]
    poor = answering(tmp_path / "c.onnx", heads, {**NAMES, "anchors": "[1, 2, 3, 4, 5, 6]"})
    assert "1 heads have anchors" in refusal(poor)
    bad = answering(tmp_path / "d.onnx", heads, {**NAMES, "anchors": "['x']"})
    assert "not heads x 3 x 2" in refusal(bad)


def test_names_from_a_file(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": rows()})
    assert "--names FILE" in refusal(path)
    names = tmp_path / "names.txt"
    names.write_text("person\nfire hydrant\n\n")
    assert contract(path, names).names == ("person", "fire hydrant")
    names.write_text("person\n")
    assert "1 classes" in refusal(path, names)
    assert "not a text file" in refusal(path, tmp_path / "missing.txt")


def test_other_networks_are_refused_with_their_shapes(tmp_path: Path) -> None:
    later = answering(tmp_path / "v8.onnx", {"output0": np.zeros((1, 6, 84), np.float32)}, NAMES)
    line = refusal(later)
    assert "found input images [1, 3, 64, 64] float and output output0 [1, 6, 84] float" in line
    assert "expected one input [1, 3, 64, 64]" in line
    assert "output [1, 252, 7], or raw heads [1, 3, 8, 8, 7], [1, 3, 4, 4, 7], [1, 3, 2, 2, 7]" in line
    masks = {"output0": rows(252, 39), "output1": np.zeros((1, 32, 16, 16), np.float32)}
    assert "output1 [1, 32, 16, 16]" in refusal(answering(tmp_path / "seg.onnx", masks, NAMES))
    ended = answering(tmp_path / "nms.onnx", {"output": np.zeros((100, 7), np.float32)}, NAMES)
    assert "[100, 7]" in refusal(ended)
    grey = answering(tmp_path / "grey.onnx", {"output0": rows()}, NAMES, (1, 1, 64, 64))
    assert "found input images [1, 1, 64, 64]" in refusal(grey)
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


def test_files_that_are_no_networks(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="No such file"):
        open_session(tmp_path / "missing.onnx")
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(ModelError, match=r"text\.onnx: not an ONNX model"):
        open_session(tmp_path / "text.onnx")


def test_an_input_that_a_network_cannot_take(tmp_path: Path) -> None:
    session = open_session(answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES))
    with pytest.raises(ModelError, match=r"failed on an input \[1, 3, 32, 32\]"):
        session.run(np.zeros((1, 3, 32, 32), np.float32))


def test_one_session_for_one_file(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES)
    assert open_session(path, threads=1) is open_session(path, threads=1)
    assert open_session(path, threads=1) is not open_session(path, threads=2)


def test_a_missing_provider_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("onnxruntime.get_available_providers", lambda: ["CPUExecutionProvider"])
    path = answering(tmp_path / "m.onnx", {"output0": rows()}, NAMES)
    with pytest.raises(UsageError, match="install onnxruntime-gpu"):
        open_session(path, "cuda")
