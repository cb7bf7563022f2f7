"""Detection stage: rules, order, losses and the second stage, with networks that answer with constants."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_landmarks.channels import ANNOTATIONS, CAMERA_IMAGE, DETECTIONS
from mcap_landmarks.config import stage_config
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.stage import Bundle, Omission, Stamped
from mcap_landmarks.stages import detect
from mcap_landmarks.stages.detect import process
from mcap_landmarks.vision.config import DetectConfig

from tests.vision.networks import NO_METADATA, Export, answering, averaging, yolov5

NAMES = {"names": "['person', 'car', 'dog']", "stride": "32"}
ROWS = (  # centre, size, objectness, a probability per class
    (32, 32, 20, 20, 0.9, 1, 0, 0),
    (33, 32, 20, 20, 0.8, 1, 0, 0),
    (16, 16, 8, 8, 0.5, 0, 1, 0),
    (48, 48, 8, 8, 0.3, 0, 0, 1),
    (10, 50, 8, 8, 0.2, 0, 0, 1),
)


def network(folder: Path, rows: Sequence[Sequence[float]] = ROWS, metadata: Mapping[str, str] = NAMES) -> Path:
    """A network with an input of 64 x 64 that always finds the same."""
    output = np.zeros((1, 252, 8), np.float32)
    output[0, : len(rows)] = np.reshape(rows, (-1, 8))
    return answering(folder / "model.onnx", {"output0": output}, metadata)


def bundle(time_ns: int, message: CompressedImage | Image | None = None, side_px: int = 64) -> Bundle:
    if message is None:
        message = Image(time_ns - 7, "camera", side_px, side_px, "mono8", False, side_px, bytes(side_px**2))
    return Bundle(message.stamp_ns or time_ns, time_ns, {CAMERA_IMAGE: message})


def run(
    resources: dict[str, Path], bundles: list[Bundle] | None = None, **settings: object
) -> list[Stamped | Omission]:
    config = stage_config(DetectConfig, "detect", {"threads": 1, **settings})
    return list(process(bundles or [bundle(1000)], config, resources))


def labels(results: list[Stamped | Omission]) -> list[str]:
    """Best class of each box of the first image."""
    first = next(r.message for r in results if isinstance(r, Stamped) and r.channel == DETECTIONS)
    assert isinstance(first, Detections)
    return [hypotheses[0][0] for hypotheses in first.hypotheses]


def test_boxes_scores_and_annotations(tmp_path: Path) -> None:
    detections, annotations = run({"model": network(tmp_path)}, [bundle(1000, side_px=128)])
    assert isinstance(detections, Stamped)
    assert isinstance(annotations, Stamped)
    assert (detections.channel, detections.log_time_ns) == (DETECTIONS, 1000)
    assert (annotations.channel, annotations.log_time_ns) == (ANNOTATIONS, 1000)
    found, drawn = detections.message, annotations.message
    assert isinstance(found, Detections)
    assert (found.stamp_ns, found.frame_id) == (993, "camera")
    assert found.boxes_xyxy.tolist() == [[44, 44, 84, 84], [24, 24, 40, 40], [88, 88, 104, 104]]
    assert [(name, round(score, 6)) for ((name, score),) in found.hypotheses] == [
        ("person", 0.9),
        ("car", 0.5),
        ("dog", 0.3),
    ]
    assert isinstance(drawn, ImageAnnotations)
    assert drawn.stamp_ns == 993
    assert drawn.outlines[0].pixels_uv.tolist() == [[44, 44], [84, 44], [84, 84], [44, 84]]
    assert [label.text for label in drawn.labels] == ["person 0.90", "car 0.50", "dog 0.30"]
    assert len({label.background for label in drawn.labels}) == 3


def test_an_image_without_objects_has_empty_messages(tmp_path: Path) -> None:
    results = run({"model": network(tmp_path, rows=ROWS[:0])})
    assert [r.channel for r in results if isinstance(r, Stamped)] == [DETECTIONS, ANNOTATIONS]
    assert labels(results) == []


def test_boxes_outside_of_the_image_are_left_out(tmp_path: Path) -> None:
    rows = [(32, 4, 10, 4, 0.9, 1, 0, 0), (32, 20, 10, 20, 0.9, 1, 0, 0)]  # the first lies in the upper margin
    wide = Image(1, "camera", 32, 64, "mono8", False, 64, bytes(32 * 64))
    found = run({"model": network(tmp_path, rows)}, [bundle(1, wide)])[0]
    assert isinstance(found, Stamped)
    assert isinstance(found.message, Detections)
    assert found.message.boxes_xyxy.tolist() == [[27, 0, 37, 14]]


def test_thresholds_and_filters(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path)}
    assert labels(run(resources, confidence=0.1)) == ["person", "car", "dog", "dog"]
    assert labels(run(resources, confidence=0.4)) == ["person", "car"]
    assert labels(run(resources, class_confidence={"car": 0.6, "dog": 0.1})) == ["person", "dog", "dog"]
    assert labels(run(resources, classes=["car", "dog"])) == ["car", "dog"]
    assert labels(run(resources, max_detections=1)) == ["person"]
    assert labels(run(resources, iou=0.95)) == ["person", "person", "car", "dog"]


def test_the_models_own_threshold(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path, metadata={**NAMES, "confidence": "0.4"})}
    assert labels(run(resources)) == ["person", "car"]
    assert labels(run(resources, confidence=0.25)) == ["person", "car", "dog"]
    assert labels(run(resources, class_confidence={"person": 0.95})) == ["car"]


def test_the_thesis_has_no_choices(tmp_path: Path) -> None:
    output = np.zeros((1, 25200, 8), np.float32)
    output[0, : len(ROWS)] = ROWS
    fixed = answering(tmp_path / "m.onnx", {"output0": output}, {**NAMES, "confidence": "0.9"}, (1, 3, 640, 640))
    found = run({"model": fixed}, method="thesis", confidence=0.6, classes=["car"], class_confidence={"car": 0.9})
    assert labels(found) == ["person", "car", "dog"]
    with pytest.raises(UsageError, match="640 x 640"):
        run({"model": network(tmp_path)}, method="thesis")


def test_classes_that_the_model_does_not_know(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path)}
    with pytest.raises(UsageError, match="detects no persn; did you mean person"):
        run(resources, classes=["persn"])
    with pytest.raises(UsageError, match="detects no zebra; it knows person, car, dog"):
        run(resources, class_confidence={"zebra": 0.5})
    with pytest.raises(UsageError, match="confidence"):
        run(resources, confidence=1.5)


def test_an_image_that_cannot_be_read_is_one_loss(tmp_path: Path) -> None:
    broken = CompressedImage(2, "camera", "jpeg", b"\xff\xd8 cut")
    results = run({"model": network(tmp_path)}, [bundle(1), bundle(2, broken), bundle(3)])
    omitted = [r for r in results if isinstance(r, Omission)]
    assert [(o.log_time_ns, o.lost) for o in omitted] == [(2, True)]
    assert "cut short" in omitted[0].reason
    assert [r.log_time_ns for r in results if isinstance(r, Stamped)] == [1, 1, 3, 3]


def test_results_come_in_the_order_of_the_images(tmp_path: Path) -> None:
    yolov5(tmp_path / "m.onnx", ["a", "b"], export=Export("h", "w"))
    rng = np.random.default_rng(0)
    images = []
    for i in range(12):
        side = int(rng.integers(32, 128))
        data = cv2.imencode(".png", rng.integers(0, 256, (side, side, 3), dtype=np.uint8))[1].tobytes()
        images.append(bundle(i + 1, CompressedImage(i + 1, "camera", "png", data)))
    results = run({"model": tmp_path / "m.onnx"}, images, size_px=64)
    found = [r.message for r in results if isinstance(r, Stamped) and r.channel == DETECTIONS]
    assert [message.stamp_ns for message in found if isinstance(message, Detections)] == list(range(1, 13))
    alone = [run({"model": tmp_path / "m.onnx"}, [image], size_px=64)[0] for image in images]
    for message, single in zip(found, alone, strict=True):
        assert isinstance(message, Detections)
        assert isinstance(single, Stamped)
        assert isinstance(single.message, Detections)
        np.testing.assert_array_equal(message.boxes_xyxy, single.message.boxes_xyxy)


def test_several_images_in_one_call_have_the_same_detections(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a GPU, with one that cannot be read and tiles of another size between them."""
    yolov5(tmp_path / "m.onnx", ["a", "b"], export=Export("h", "w", form="heads", batch="images"))
    rng = np.random.default_rng(0)
    images = [bundle(5, CompressedImage(5, "camera", "jpeg", b"\xff\xd8 cut"))]
    for i, width in enumerate((64, 96, 64, 64, 200, 64, 96)):
        data = cv2.imencode(".png", rng.integers(0, 256, (64, width, 3), dtype=np.uint8))[1].tobytes()
        images.append(bundle(i + 10, CompressedImage(i + 10, "camera", "png", data)))
    asked = {"size_px": 64, "tiles": "auto", "confidence": 0.3}
    alone = run({"model": tmp_path / "m.onnx"}, images, **asked)
    monkeypatch.setattr(detect, "images_at_once", lambda _, wanted: wanted)
    together = run({"model": tmp_path / "m.onnx"}, images, batch=3, **asked)
    assert [one.log_time_ns for one in together] == [one.log_time_ns for one in alone]
    for one, other in zip(alone, together, strict=True):
        if isinstance(one, Stamped) and isinstance(one.message, Detections):
            assert isinstance(other, Stamped)
            assert isinstance(other.message, Detections)
            assert len(one.message.hypotheses) > 0
            assert [[name for name, _ in options] for options in one.message.hypotheses] == [
                [name for name, _ in options] for options in other.message.hypotheses
            ]
            np.testing.assert_allclose(one.message.boxes_xyxy, other.message.boxes_xyxy, atol=1e-3)


def classifier(folder: Path, shares: list[float], metadata: Mapping[str, str] = NAMES) -> Path:
    return answering(folder / "classes.onnx", {"output": np.array([shares], np.float32)}, metadata)


def test_a_classifier_can_veto(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path), "classifier": classifier(tmp_path, [0.1, 0.8, 0.1])}
    results = run(resources)
    assert labels(results) == ["car"]
    reasons = [r.reason for r in results if isinstance(r, Omission)]
    assert reasons == [f"detections of {name} that the classifier takes for car" for name in ("person", "dog")]
    assert not any(r.lost for r in results if isinstance(r, Omission))
    assert labels(run(resources, classifier_confidence=0.9)) == ["person", "car", "dog"]


def test_a_classifier_can_relabel(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path), "classifier": classifier(tmp_path, [0.2, 0.8, 0])}
    first = run(resources, classifier_action="relabel")[0]
    assert isinstance(first, Stamped)
    assert isinstance(first.message, Detections)
    flat = [[(name, round(score, 6)) for name, score in options] for options in first.message.hypotheses]
    assert flat == [[("car", 0.9), ("person", 0.225)], [("car", 0.5)], [("car", 0.3), ("dog", 0.0)]]


def test_logits_become_probabilities(tmp_path: Path) -> None:
    logits = classifier(tmp_path, [1.0, 1.2, -5.0])  # car is ahead with a probability of 0.55
    assert labels(run({"model": network(tmp_path), "classifier": logits}, classifier_confidence=0.5)) == ["car"]
    assert len(labels(run({"model": network(tmp_path), "classifier": logits}, classifier_confidence=0.6))) == 3


def test_the_thesis_vetoes_whatever_differs(tmp_path: Path) -> None:
    output = np.zeros((1, 25200, 8), np.float32)
    output[0, : len(ROWS)] = ROWS
    model = answering(tmp_path / "m.onnx", {"output0": output}, NAMES, (1, 3, 640, 640))
    resources = {"model": model, "classifier": classifier(tmp_path, [0.34, 0.33, 0.33])}
    assert labels(run(resources)) == ["person", "car", "dog"]
    assert labels(run(resources, method="thesis", classifier_action="relabel")) == ["person"]


def test_a_classifier_has_no_say_about_classes_it_does_not_know(tmp_path: Path) -> None:
    cats = classifier(tmp_path, [0.9, 0.1], {"names": "['cat', 'dog']"})
    assert labels(run({"model": network(tmp_path), "classifier": cats})) == ["person", "car"]


def test_names_of_a_classifier(tmp_path: Path) -> None:
    resources = {"model": network(tmp_path), "classifier": classifier(tmp_path, [0, 1, 0], NO_METADATA)}
    assert labels(run(resources)) == ["car"]
    with pytest.raises(ModelError, match="does not fit 3 class names"):
        run({**resources, "classifier": classifier(tmp_path, [0.5, 0.5], NO_METADATA)})
    with pytest.raises(ModelError, match="not an image classifier"):
        run({**resources, "classifier": network(tmp_path)})
    with pytest.raises(ModelError, match=r"found an output of shape \[1, 224\], expected \[1, 3\]"):
        run({**resources, "classifier": averaging(tmp_path / "wide.onnx")})


@pytest.mark.parametrize(
    ("photo", "wanted"),
    [
        ("dog", ({"dog", "bicycle"}, {"truck", "car"})),
        ("person", ({"person", "dog", "horse"},)),
        ("horses", ({"horse"},)),
    ],
)
def test_the_stock_model_sees_what_is_there(shared_data: Path, photo: str, wanted: tuple[set[str], ...]) -> None:
    data = (shared_data / "photos" / f"{photo}.jpg").read_bytes()
    image = bundle(1, CompressedImage(1, "camera", "jpeg", data))
    for method in ("default", "thesis"):
        found = set(labels(run({"model": shared_data / "models" / "yolov5n-coco.onnx"}, [image], method=method)))
        assert wanted[0] <= found
        assert not wanted[1:] or found & wanted[1]


def test_the_stage_declares_its_files() -> None:
    assert detect.STAGE.resources == ("model",)
    assert detect.STAGE.options == ("names", "classifier")
