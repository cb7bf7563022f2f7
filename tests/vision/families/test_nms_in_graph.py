"""Detectors that end in non-maximum suppression: which outputs are recognised, and what rows become."""

import re
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from numpy.typing import DTypeLike, NDArray

from tests.vision.families.answers import CELLS, THRESHOLDS, assert_equal_to_plain, found_in, opened
from tests.vision.reference import Box

ONE_CLASS = {"names": "['person']"}
NAMES_OF_TENSORRT = ("num_dets", "det_boxes", "det_scores", "det_classes")
ENDS = {"description": "Ultralytics YOLO26n model", "end2end": "True"}


def table(count: int = 200) -> NDArray[np.float32]:
    """Random corners, scores and classes (count, 6); some classes are none of the three."""
    rng = np.random.default_rng(3)
    low = rng.uniform(0, 60, (count, 2))
    parts = low, low + rng.uniform(1, 30, (count, 2)), rng.uniform(0, 1, (count, 1)), rng.integers(-1, 5, (count, 1))
    return np.concatenate(parts, axis=1).astype(np.float32)


def plain(rows: NDArray[np.float32]) -> list[Box]:
    found: list[Box] = []
    for left, top, right, bottom, score, number in rows.tolist():
        if number in (0, 1, 2) and score > THRESHOLDS[int(number)]:
            found.append((left, top, right, bottom, score, int(number)))
    return found


def test_rows_of_six(tmp_path: Path) -> None:
    detector = opened(tmp_path, {"output0": table()[None]})
    assert (detector.family.name, detector.family.needs_nms) == ("nms_in_graph", False)
    assert_equal_to_plain(detector, plain(table()))


def test_rows_of_seven_have_the_image_first_and_the_score_last(tmp_path: Path) -> None:
    rows = np.column_stack([np.zeros(200), table()[:, [0, 1, 2, 3, 5, 4]]]).astype(np.float32)
    assert_equal_to_plain(opened(tmp_path, {"output": rows}), plain(table()))


@pytest.mark.parametrize(
    "names", [("num_dets", "det_boxes", "det_scores", "det_classes"), ("num", "boxes", "scores", "labels")]
)
@pytest.mark.parametrize("kind", [np.int32, np.float32])
def test_four_outputs_of_which_the_first_tells_how_many_rows_count(
    tmp_path: Path, names: tuple[str, ...], kind: DTypeLike
) -> None:
    rows = table()
    parts = np.array([[150]], np.int32), rows[None, :, :4], rows[None, :, 4], rows[None, :, 5].astype(kind)
    detector = opened(tmp_path, dict(zip(names, parts, strict=True)))
    assert detector.family.name == "nms_in_graph"
    assert_equal_to_plain(detector, plain(rows[:150]))
    shuffled = {names[i]: parts[i] for i in (3, 1, 0, 2)}
    assert_equal_to_plain(opened(tmp_path, shuffled), plain(rows[:150]))


def test_a_box_comes_back_to_the_image(tmp_path: Path) -> None:
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, 0] = 36, 26, 60, 38, 0.9, 2
    found = found_in(opened(tmp_path, {"output0": rows}), (480, 960))
    np.testing.assert_allclose(found.boxes_xyxy, [[360, 180, 600, 300]])


def test_no_second_suppression(tmp_path: Path) -> None:
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, :2] = [[36, 26, 60, 38, 0.9, 2], [36, 26, 60, 38, 0.8, 2]]
    assert len(found_in(opened(tmp_path, {"output0": rows}), (480, 960)).scores) == 2


def test_detectors_of_one_class_have_six_columns_too(tmp_path: Path) -> None:
    """YOLOv5's 4 + 1 + 1, with as many rows as its grid has cells, or free rows and a stride in the metadata."""
    assert opened(tmp_path, {"o": np.zeros((1, 3 * CELLS, 6), np.float32)}, ONE_CLASS).family.name == "yolov5"
    assert opened(tmp_path, {"o": np.zeros((1, CELLS, 6), np.float32)}, ONE_CLASS).family.name == "yolox"
    assert opened(tmp_path, {"o": np.zeros((1, 300, 6), np.float32)}, ONE_CLASS).family.name == "nms_in_graph"


def test_detr_of_two_classes_has_six_columns_too(tmp_path: Path) -> None:
    content, two = {"output0": np.zeros((1, 300, 6), np.float32)}, {"names": "['person', 'car']"}
    with pytest.raises(UsageError, match=re.escape("detr (RT-DETR, D-FINE or RF-DETR) or nms_in_graph")):
        opened(tmp_path, content, two)
    assert opened(tmp_path, content, {**two, **ENDS}).family.name == "nms_in_graph"
    assert opened(tmp_path, content, {**two, "description": "Ultralytics rtdetr-l model"}).family.name == "detr"
