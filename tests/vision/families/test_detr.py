"""RT-DETR, D-FINE and RF-DETR: which outputs are recognised, how images are fed, and decoding against plain loops."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import prepare
from mcap_landmarks.vision.detector import Detector
from numpy.typing import NDArray

from tests.vision.families.answers import (
    INPUT_PX,
    METADATA,
    THRESHOLDS,
    assert_equal_to_plain,
    best,
    corners,
    found_in,
    opened,
)
from tests.vision.reference import Box

QUERIES = 100
RTDETR = {**METADATA, "description": "Ultralytics rtdetr-l model"}


def boxes() -> NDArray[np.float32]:
    """Centres and sizes (QUERIES, 4) as shares of the input."""
    return np.random.default_rng(4).uniform(0.1, 0.6, (QUERIES, 4)).astype(np.float32)


def logits() -> NDArray[np.float32]:
    return np.random.default_rng(5).normal(-1, 1, (QUERIES, 3)).astype(np.float32)


def shares(table: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.array([[1 / (1 + math.exp(-value)) for value in row] for row in table], np.float32)


def in_pixels(x: float, y: float, width: float, height: float) -> tuple[float, float, float, float]:
    return corners(x * INPUT_PX[1], y * INPUT_PX[0], width * INPUT_PX[1], height * INPUT_PX[0])


def plain() -> list[Box]:
    """One query after the other."""
    found: list[Box] = []
    for box, scores in zip(boxes().tolist(), shares(logits()).tolist(), strict=True):
        class_id = best(scores)
        if class_id is not None:
            found.append((*in_pixels(*box), scores[class_id], class_id))
    return found


def chosen() -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Scores and classes (QUERIES,) as a network chooses them; some are none of the three."""
    rng = np.random.default_rng(6)
    return rng.uniform(0, 1, QUERIES).astype(np.float32), rng.integers(-1, 5, QUERIES)


def plain_of_chosen() -> list[Box]:
    found: list[Box] = []
    for box, score, number in zip(boxes().tolist(), *(part.tolist() for part in chosen()), strict=True):
        if number in (0, 1, 2) and score > THRESHOLDS[number]:
            found.append((*in_pixels(*box), score, number))
    return found


def test_rows_of_ultralytics(tmp_path: Path) -> None:
    rows = np.concatenate([boxes(), shares(logits())], axis=1)[None]
    for metadata in (RTDETR, METADATA):
        detector = opened(tmp_path, {"output0": rows}, metadata)
        assert (detector.family.name, detector.family.needs_nms) == ("detr", False)
        assert_equal_to_plain(detector, plain())


def test_its_later_rows_of_chosen_classes(tmp_path: Path) -> None:
    rows = np.column_stack([boxes(), *chosen()]).astype(np.float32)[None]
    detector = opened(tmp_path, {"output0": rows}, {**RTDETR, "head": "RTDETRDecoder"})
    assert detector.family.name == "detr"
    assert_equal_to_plain(detector, plain_of_chosen())


def test_tables_of_rfdetr(tmp_path: Path) -> None:
    detector = opened(tmp_path, {"dets": boxes()[None], "labels": logits()[None]})
    assert detector.family.name == "detr"
    assert_equal_to_plain(detector, plain())


def test_rfdetr_on_coco_needs_the_names_of_its_columns(tmp_path: Path) -> None:
    """Its 91 columns are COCO's own numbers, of which 80 are used: names in a row would be wrong ones."""
    coco = {"names": str([f"class {i}" for i in range(80)])}
    with pytest.raises(ModelError, match=r"labels \[1, 100, 91\] float; expected .*logits \[1, \?, 80\]"):
        opened(tmp_path, {"dets": boxes()[None], "labels": np.zeros((1, QUERIES, 91), np.float32)}, coco)


def test_tables_of_transformers(tmp_path: Path) -> None:
    detector = opened(tmp_path, {"logits": logits()[None], "pred_boxes": boxes()[None]}, sides=("h", "w"))
    assert_equal_to_plain(detector, plain())


def processed() -> Mapping[str, NDArray[Any]]:
    scores, labels = chosen()
    edges = np.array([corners(*box) for box in boxes().tolist()], np.float32)
    return {"labels": labels[None], "boxes": edges[None], "scores": scores[None]}


def test_outputs_for_an_image_size_that_is_given(tmp_path: Path) -> None:
    detector = opened(tmp_path, processed(), sized="orig_target_sizes")
    assert detector.layout.constants["orig_target_sizes"].tolist() == [[1, 1]]
    assert_equal_to_plain(detector, plain_of_chosen())


def colours_of(detector: Detector) -> list[float]:
    array = prepare(np.full((480, 480, 3), (10, 20, 30), np.uint8), detector, DetectConfig())[0].array
    assert np.ptp(array, axis=(0, 2, 3)).max() == 0  # the whole input is image
    return [float(value) for value in array[0, :, 0, 0]]


def test_images_are_stretched_and_normalised_as_in_training(tmp_path: Path) -> None:
    plainly = opened(tmp_path, processed(), sized="orig_target_sizes")
    np.testing.assert_allclose(colours_of(plainly), np.array([10, 20, 30]) / 255, rtol=1e-6)
    by_imagenet = opened(tmp_path, {"dets": boxes()[None], "labels": logits()[None]})
    wanted = (np.array([10, 20, 30]) / 255 - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    np.testing.assert_allclose(colours_of(by_imagenet), wanted, rtol=1e-4)


def test_a_box_comes_back_to_the_image(tmp_path: Path) -> None:
    rows = np.zeros((1, QUERIES, 7), np.float32)
    rows[0, 3] = 0.5, 0.25, 0.2, 0.1, 0, 0, 0.9
    found = found_in(opened(tmp_path, {"output0": rows}, RTDETR), (1000, 500))
    np.testing.assert_allclose(found.boxes_xyxy, [[200, 200, 300, 300]], rtol=1e-5)
    assert (found.class_ids.tolist(), found.scores.tolist()) == ([2], [np.float32(0.9)])
