"""The verb export for COCO: a dataset by its rules, with the boxes of the log."""

import json
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, TRUTH_DETECTIONS
from mcap_landmarks.cli.console import DONE, INTERRUPTED
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from tests.cli.calls import call, refused, schema_of, topics
from tests.diff.recordings import localized_log
from tests.runs.chain import STEP_NS, raw_messages


def dataset(log: Path, folder: Path, *more: object) -> dict[str, Any]:
    """The dataset of a log, which must follow COCO's rules."""
    out = folder / "boxes.json"
    assert call("export", log, "--format", "coco", "-o", out, "--overwrite", *more) == DONE
    found: dict[str, Any] = json.loads(out.read_text())
    assert found.pop("info").keys() == {"description"}
    assert found.keys() == {"images", "annotations", "categories"}
    numbers = {name: [entry["id"] for entry in entries] for name, entries in found.items()}
    assert all(len(set(ids)) == len(ids) and 0 not in ids for ids in numbers.values())
    images = {image["id"]: image for image in found["images"]}
    assert len({image["file_name"] for image in images.values()}) == len(images)
    for box in found["annotations"]:
        assert box["category_id"] in numbers["categories"]
        image, (left, top, width, height) = images[box["image_id"]], box["bbox"]
        assert 0 <= left < left + width <= image["width"] + 1e-9
        assert 0 <= top < top + height <= image["height"] + 1e-9
        assert box["area"] == pytest.approx(width * height)
        assert box["iscrowd"] == 0
        assert 0 <= box["score"] <= 1
    return found


def boxes_of(log: Path, topic: str) -> list[tuple[int, str, float, list[float]]]:
    """Stamp, class, score and corners of every box of a topic."""
    with open_recording(log) as recording:
        messages = [decode(Detections, raw.data) for raw in recording.messages(recording.connections(topic))]
    return [
        (one.stamp_ns, *options[0], box)
        for one in messages
        for options, box in zip(one.hypotheses, one.boxes_xyxy.tolist(), strict=True)
    ]


@pytest.mark.parametrize("topic", [DETECTIONS.topic, TRUTH_DETECTIONS.topic])
def test_the_boxes_are_those_of_the_log(topic: str, whole_result: Path, tmp_path: Path) -> None:
    found = dataset(whole_result, tmp_path, "--topic", topic)
    names = {entry["id"]: entry["name"] for entry in found["categories"]}
    assert names == {1: "person", 11: "fire hydrant", 33: "suitcase"}  # as COCO 2017 counts
    stamps = {image["id"]: int(Path(image["file_name"]).stem) for image in found["images"]}
    wanted = boxes_of(whole_result, topic)
    assert len(found["annotations"]) == len(wanted) > 50
    for box, (stamp_ns, name, score, corners) in zip(found["annotations"], wanted, strict=True):
        assert (stamps[box["image_id"]], names[box["category_id"]]) == (stamp_ns, name)
        assert box["score"] == pytest.approx(score)
        left, top, width, height = box["bbox"]
        clipped = np.clip(corners, 0, [640, 480] * 2)
        assert [left, top, left + width, top + height] == pytest.approx(clipped.tolist())


def test_images_and_categories_have_the_same_numbers_for_truth_and_detections(
    whole_result: Path, tmp_path: Path
) -> None:
    mine, truth = dataset(whole_result, tmp_path), dataset(whole_result, tmp_path, "--topic", TRUTH_DETECTIONS.topic)
    assert (mine["images"], mine["categories"]) == (truth["images"], truth["categories"])


def test_images_are_written_as_they_are(whole_result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "images"
    found = dataset(whole_result, tmp_path, "--images", folder, "--json")
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("export"))
    assert document["images"] == topics(whole_result)[CAMERA_IMAGE.topic] == len(found["images"])
    assert sorted(path.name for path in folder.iterdir()) == sorted(image["file_name"] for image in found["images"])
    first = cv2.imread(str(folder / found["images"][0]["file_name"]))
    assert first is not None
    assert first.shape == (480, 640, 3)
    words = "export", whole_result, "--format", "coco", "-o", tmp_path / "b.json", "--images", folder
    assert "exists" in refused(capsys, 2, *words)


def test_boxes_beyond_their_image_are_cut_or_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Images of 64 x 48; classes that COCO lacks have numbers of their own."""
    log = tmp_path / "log.mcap"
    corners = np.array([[-5.0, 10, 20, 60], [70, 10, 90, 20], [1, 2, 3, 4]])
    classes = ("post", 0.9), ("post", 0.8), ("person", 0.7)
    boxes = Detections(STEP_NS, "camera", ("", "", ""), tuple((one,) for one in classes), corners)
    lone = Detections(STEP_NS + 1, "camera", ("",), ((("post", 0.5),),), corners[2:])
    with create_recording(log) as writer:
        for stamped in (*raw_messages(2), Stamped(DETECTIONS, STEP_NS, boxes), Stamped(DETECTIONS, STEP_NS, lone)):
            writer.add(stamped)
    found = dataset(log, tmp_path)
    assert [(box["category_id"], box["bbox"]) for box in found["annotations"]] == [
        (1001, [0, 10, 20, 38]), (1, [1, 2, 2, 2])
    ]  # fmt: skip
    told = capsys.readouterr().err
    assert "boxes without a class or an area in the image: 1, left out" in told
    assert "boxes without an image: 1, left out" in told


def test_trouble_is_told(whole_result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, log = tmp_path / "boxes.json", localized_log(tmp_path / "r.mcap")
    words = "--format", "coco", "-o", out
    assert "has neither detections nor the truth" in refused(capsys, 1, "export", log, *words)
    assert "/scan has no boxes in images" in refused(capsys, 2, "export", whole_result, *words, "--topic", "/scan")
    assert not out.exists()


def test_its_own_earlier_result_is_written_again_and_nothing_else(
    whole_result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, images = tmp_path / "boxes.json", tmp_path / "images"
    words = "export", whole_result, "--format", "coco", "-o", out, "--images", images
    for _ in range(2):
        assert call(*words) == DONE
    (images / "notes.txt").write_text("mine")
    assert "--overwrite" in refused(capsys, 2, *words)
    (images / "notes.txt").unlink()
    out.write_text("{}")
    assert "--overwrite" in refused(capsys, 2, *words)
    assert "beside that folder" in refused(capsys, 2, *words[:-3], images / "boxes.json", "--images", images)


def test_who_stops_it_has_neither_images_nor_boxes(
    whole_result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mcap_landmarks.report.coco_dataset._annotations", stopped)  # when all images are there
    folder = tmp_path / "out"
    folder.mkdir()
    words = "export", whole_result, "--format", "coco", "-o", folder / "boxes.json", "--images", folder / "images"
    assert call(*words) == INTERRUPTED
    assert list(folder.iterdir()) == []
    assert len(capsys.readouterr().err.splitlines()) == 1
