"""Detection from the command line: channels, namespaces, losses and refusals."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, DETECTIONS
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.calls import call, refused, topics
from tests.cli.logs import write
from tests.vision.networks import answering

SECOND = 10**9
SCHEMA: Any = json.loads(resource("schemas", "json/detect.schema.json").read_text())


def jpeg(i: int) -> bytes:
    picture = np.full((48, 64, 3), 20 * i, np.uint8)
    return bytes(cv2.imencode(".jpg", picture)[1].tobytes())


def images(topic: str = CAMERA_IMAGE.topic, count: int = 5) -> list[Stamped]:
    channel = Channel(topic, CompressedImage)
    return [
        Stamped(channel, (i + 1) * SECOND, CompressedImage((i + 1) * SECOND - 30, "camera", "jpeg", jpeg(i)))
        for i in range(count)
    ]


def info(topic: str) -> Stamped:
    message = CameraInfo(1, "camera", 48, 64, "plumb_bob", np.zeros(5), np.eye(3), np.eye(3), np.eye(3, 4))
    return Stamped(Channel(topic, CameraInfo), SECOND, message)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A detector that sees a person and a car in every image."""
    output = np.zeros((1, 252, 7), np.float32)
    output[0, :2] = (32, 32, 20, 20, 0.9, 1, 0), (16, 16, 8, 8, 0.5, 0, 1)
    folder = tmp_path_factory.mktemp("models")
    return answering(folder / "model.onnx", {"output0": output}, {"names": "['person', 'car']", "stride": "32"})


def detected(tmp_path: Path, model: Path, content: Sequence[Stamped], *words: object) -> Path:
    log, out = write(tmp_path / "log.mcap", list(content)), tmp_path / "out.mcap"
    assert call("detect", log, "-o", out, "--model", model, *words) == 0
    return out


def test_the_output_has_detections_beside_the_input(
    tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = detected(tmp_path, model, [info(CAMERA_INFO.topic), *images()], "--json")
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert (document["images"], document["unreadable"], document["detections"]) == (5, 0, 10)
    assert document["classes"] == {"car": 5, "person": 5}
    assert topics(out) == {
        CAMERA_IMAGE.topic: 5,
        CAMERA_INFO.topic: 1,
        DETECTIONS.topic: 5,
        "/camera/annotations": 5,
    }
    with open_recording(out) as recording:
        raws = list(recording.messages())
        assert json.loads(recording.metadata[RUN]["resources"]).keys() == {"model"}
        assert str(tmp_path) not in str(recording.metadata)
    for raw in raws:
        if raw.connection.topic == DETECTIONS.topic:
            found = decode(Detections, raw.data)
            assert (found.stamp_ns, found.frame_id) == (raw.log_time_ns - 30, "camera")
        if raw.connection.topic == "/camera/annotations":
            assert decode(ImageAnnotations, raw.data).stamp_ns == raw.log_time_ns - 30


@pytest.mark.parametrize(
    ("image", "infos", "annotations"),
    [
        ("/front/image_raw/compressed", ["/front/camera_info", "/rear/camera_info"], "/front/annotations"),
        ("/rear/image_raw/compressed", ["/front/camera_info", "/rear/camera_info"], "/rear/annotations"),
        (
            "/robot/left/image/compressed",
            ["/robot/left/camera_info", "/robot/right/camera_info"],
            "/robot/left/annotations",
        ),
        ("/usb_cam/image_raw", ["/calibration/camera_info"], "/calibration/annotations"),
        ("/usb_cam/image_raw/compressed", [], "/usb_cam/annotations"),
        ("/usb_cam/image_raw", ["/front/camera_info", "/rear/camera_info"], "/usb_cam/annotations"),
        ("/image", ["/camera_info"], "/annotations"),
    ],
)
def test_annotations_follow_the_camera(
    tmp_path: Path, model: Path, image: str, infos: list[str], annotations: str
) -> None:
    out = detected(tmp_path, model, [*map(info, infos), *images(image, 1)])
    assert topics(out).keys() - {image, *infos} == {DETECTIONS.topic, annotations}


def test_raw_images_and_the_choice_of_a_topic(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    message = Image(SECOND, "camera", 48, 64, "bgr8", False, 192, bytes(48 * 192))
    raw = Stamped(Channel("/camera/image_raw", Image), SECOND, message)
    log = write(tmp_path / "two.mcap", [raw, *images()])
    assert call("detect", log, "-o", tmp_path / "out.mcap", "--model", model) == 2
    assert "/camera/image_raw and /camera/image_raw/compressed could be the image" in capsys.readouterr().err
    assert call("detect", log, "-o", tmp_path / "out.mcap", "--model", model, "--image", "/camera/image_raw") == 0
    assert topics(tmp_path / "out.mcap")[DETECTIONS.topic] == 1


def test_twice_the_same_bytes_and_results_are_replaced(tmp_path: Path, model: Path) -> None:
    out = detected(tmp_path, model, images())
    again = tmp_path / "again.mcap"
    assert call("detect", out, "-o", again, "--model", model) == 0
    assert topics(again) == topics(out)
    third = tmp_path / "third.mcap"
    assert call("detect", again, "-o", third, "--model", model) == 0
    assert third.read_bytes() == again.read_bytes()


def test_results_only_and_spans(tmp_path: Path, model: Path) -> None:
    out = detected(tmp_path, model, images(), "--results-only", "--start", 2 * SECOND, "--end", 4 * SECOND)
    assert topics(out) == {DETECTIONS.topic: 2, "/camera/annotations": 2}


def test_settings(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    detected(tmp_path, model, images(), "--set", "detect.confidence=0.6")
    assert "5 person" in capsys.readouterr().out
    config = tmp_path / "config.toml"
    config.write_text(f'[detect]\nmodel = "{model}"\nclasses = ["car"]\n')
    assert call("detect", tmp_path / "log.mcap", "-o", tmp_path / "out.mcap", "--config", config) == 0
    assert capsys.readouterr().out.endswith(": 5 car\n")
    names = tmp_path / "names.txt"
    names.write_text("dog\ncat\n")
    assert call("detect", tmp_path / "log.mcap", "-o", tmp_path / "o.mcap", "--model", model, "--names", names) == 0
    assert "5 cat, 5 dog" in capsys.readouterr().out


def test_a_corrupt_image_is_a_loss(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = images()
    for i in (1, 3):
        cut = CompressedImage(content[i].log_time_ns, "camera", "jpeg", jpeg(i)[:100])
        content[i] = Stamped(CAMERA_IMAGE, content[i].log_time_ns, cut)
    log = write(tmp_path / "log.mcap", content)
    assert call("detect", log, "-o", tmp_path / "out.mcap", "--model", model, "--json") == 3
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert (document["images"], document["unreadable"]) == (5, 2)
    assert document["losses"][0] == f"{CAMERA_IMAGE.topic} at {moment(2 * SECOND)}: the JPEG of 100 bytes is cut short"
    assert "2 messages could not be decoded in all" in document["losses"][1]
    assert topics(tmp_path / "out.mcap") == {CAMERA_IMAGE.topic: 5, DETECTIONS.topic: 3, "/camera/annotations": 3}
    poor = write(tmp_path / "poor.mcap", [content[1]])
    assert call("detect", poor, "-o", tmp_path / "poor_out.mcap", "--model", model) == 1
    assert "none of 1 images could be read" in capsys.readouterr().err
    assert not (tmp_path / "poor_out.mcap").exists()


def test_vetoes_are_counted(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    second = answering(tmp_path / "second.onnx", {"output": np.array([[0.1, 0.9]], np.float32)})
    detected(tmp_path, model, images(), "--set", f"detect.classifier={second}", "--json")
    document = json.loads(capsys.readouterr().out)
    assert document["dropped"] == {"detections of person that the classifier takes for car": 5}
    assert document["classes"] == {"car": 5}


def test_many_logs(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = [write(tmp_path / f"{name}.mcap", images()) for name in "ab"]
    assert call("detect", *logs, "-o", tmp_path / "out", "--model", model, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert len(document["logs"]) == 2


def test_the_bundled_one_looks_at_any_log_where_one_insists(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", images()), tmp_path / "out.mcap"
    assert call("detect", log, "-o", out, "--model", "bundled", "--json") == 0
    assert json.loads(capsys.readouterr().out)["images"] > 0
    assert call("detect", log, "-o", out, "--model", "bundled", "--set", "detect.classes=['unicorn']") == 2
    assert "detector.onnx detects no unicorn" in capsys.readouterr().err


def test_refusals(tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", images()), tmp_path / "out.mcap"
    other = answering(tmp_path / "other.onnx", {"output0": np.zeros((1, 84, 84), np.float32)}, {"names": "['a']"})
    blind = write(tmp_path / "blind.mcap", [info(CAMERA_INFO.topic)])
    for code, said, words in (
        (1, "no.onnx: cannot be read", (log, "--model", tmp_path / "no.onnx")),
        (1, "expected [1, ?, 5]", (log, "--model", other)),
        (1, "there is no image (sensor_msgs/msg/CompressedImage", (blind, "--model", model)),
        (2, "did you mean confidence", (log, "--model", model, "--set", "detect.confidense=0.1")),
        (2, "detects no cat", (log, "--model", model, "--set", "detect.classes=['cat']")),
    ):
        capsys.readouterr()
        assert call("detect", *words, "-o", out) == code, said
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1, lines
        assert said in lines[0]
        assert not out.exists()


def one_car(folder: Path, family: str) -> Path:
    """A detector of an input of 64 x 64 that sees one car of 32 x 24 around (30, 36), as models of a family say it."""
    boxes, scores, classes = np.zeros((1, 100, 4), np.float32), np.zeros((1, 100), np.float32), np.zeros((1, 100), "i4")
    boxes[0, 0], scores[0, 0], classes[0, 0] = (14, 24, 46, 48), 0.9, 1
    head = np.zeros((1, 6, 84), np.float32)
    head[0, :, 0] = 30, 36, 32, 24, 0, 0.9
    count = np.ones((1, 1), np.int32)
    outputs = {
        "yolov8": {"output0": head},
        "nms_in_graph": {"num_dets": count, "det_boxes": boxes, "det_scores": scores, "det_classes": classes},
    }
    return answering(folder / "model.onnx", outputs[family], {"names": "['person', 'car']", "stride": "32"})


@pytest.mark.parametrize("family", ["yolov8", "nms_in_graph"])
def test_models_of_other_families_detect(tmp_path: Path, family: str) -> None:
    out = detected(tmp_path, one_car(tmp_path, family), images(count=2))
    with open_recording(out) as recording:
        raws = recording.messages(recording.connections(DETECTIONS.topic))
        found = [decode(Detections, raw.data) for raw in raws]
    assert [one.boxes_xyxy.tolist() for one in found] == [[[14, 16, 46, 40]]] * 2  # eight pixels of margin above
    assert [one.hypotheses[0][0][0] for one in found] == ["car", "car"]


def test_the_provider_that_ran_is_what_counts(
    tmp_path: Path, model: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Results of two providers are not the same bytes, and `auto` may be either."""
    detected(tmp_path, model, images(), "--json", "--set", "detect.provider=auto")
    assert json.loads(capsys.readouterr().out)["stages"] == {"detect": "ran"}
    with open_recording(tmp_path / "out.mcap") as recording:
        assert json.loads(recording.metadata[RUN]["config"])["detect"]["provider"] == "cpu"
    detected(tmp_path, model, images(), "--json")
    assert json.loads(capsys.readouterr().out)["stages"] == {"detect": "reused"}
    monkeypatch.setattr("mcap_landmarks.vision.providers.best_provider", lambda: "cuda")
    log, out = tmp_path / "log.mcap", tmp_path / "out.mcap"
    assert call("detect", log, "-o", out, "--model", model, "--set", "detect.provider=auto") == 2
    assert "detect.provider = cuda: this onnxruntime has no CUDAExecutionProvider" in capsys.readouterr().err


@pytest.mark.slow
def test_segments_over_two_processes_give_the_same_bytes(model: Path, tmp_path: Path) -> None:
    whole = detected(tmp_path, model, images(count=9))
    cut = tmp_path / "cut.mcap"
    words = ("detect", tmp_path / "log.mcap", "-o", cut, "--model", model, "--segments", 3, "--workers", 2)
    assert call(*words) == 0
    assert cut.read_bytes() == whole.read_bytes()
    assert not list(tmp_path.glob(".*"))


def test_segments_take_a_length_and_workers_segments(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write(tmp_path / "log.mcap", images())
    words = ("detect", log, "-o", tmp_path / "out.mcap", "--model", model)
    assert "above 0, such as 60" in refused(capsys, 2, *words, "--segments", 0)
    assert "--workers takes --segments SECONDS" in refused(capsys, 2, *words, "--workers", 2)
