"""Scores of detections against labels, on cases small enough to count by hand."""

import numpy as np
import pytest
from mcap_landmarks_generator.training.pictures import Labels
from mcap_landmarks_generator.training.scoring import Found, iou, joined, score

BOX, AWAY = [10.0, 10.0, 30.0, 50.0], [100.0, 10.0, 120.0, 50.0]


def _labels(*boxes: list[float], classes: list[int] | None = None, shares: list[float] | None = None) -> Labels:
    count = len(boxes)
    return Labels(
        np.array(classes or [0] * count, np.int64),
        np.array(boxes).reshape(-1, 4),
        np.array(shares or [1.0] * count),
        np.arange(count) * 5.0 + 3.0,
    )


def _found(*boxes: list[float], scores: list[float], classes: list[int] | None = None) -> Found:
    return Found(np.array(boxes).reshape(-1, 4), np.array(scores), np.array(classes or [0] * len(boxes), np.int64))


def test_overlap_of_known_boxes() -> None:
    shifted = [20.0, 10.0, 40.0, 50.0]  # half of each is shared: a third of the union
    assert iou(np.array([BOX]), np.array([BOX, shifted, AWAY])) == pytest.approx(np.array([[1.0, 1 / 3, 0.0]]))


def test_everything_found_is_perfect() -> None:
    scored = score([_found(BOX, AWAY, scores=[0.9, 0.8])], [_labels(BOX, AWAY)], 0)
    assert scored.average_precision() == 1.0
    assert scored.recall(0.85) == 0.5
    assert scored.recall(0.5, 0.0, 5.0) == 1.0
    assert scored.precision(0.5) == 1.0


def test_a_second_box_on_an_object_is_wrong() -> None:
    scored = score([_found(BOX, BOX, scores=[0.9, 0.8])], [_labels(BOX)], 0)
    assert scored.precision(0.5) == 0.5


def test_another_class_is_neither_found_nor_right() -> None:
    found, labels = [_found(BOX, scores=[0.9], classes=[1])], [_labels(BOX)]
    assert score(found, labels, 0).recall(0.1) == 0.0
    assert score(found, labels, 1).precision(0.1) == 0.0


def test_what_hardly_shows_does_not_count() -> None:
    found, labels = [_found(BOX, scores=[0.9])], [_labels(BOX, AWAY, shares=[0.3, 1.0])]
    scored = score(found, labels, 0)
    assert scored.excused.tolist() == [True]
    assert scored.distances_m.tolist() == [8.0]
    assert np.isnan(scored.precision(0.1))


def test_half_found_behind_a_wrong_one_has_a_quarter_of_the_area() -> None:
    # Best first: wrong, right, so precision is a half for recalls up to a half: 51 of the 101 points.
    scored = score([_found([200.0, 0, 220, 40], BOX, scores=[0.9, 0.8])], [_labels(BOX, AWAY)], 0)
    assert scored.average_precision() == pytest.approx(0.5 * 51 / 101)


def test_images_and_classes_are_joined() -> None:
    one = score([_found(BOX, scores=[0.9]), _found(scores=[])], [_labels(BOX), _labels(BOX)], 0)
    both = joined([one, one])
    assert one.recall(0.5) == both.recall(0.5) == 0.5
    assert len(both.scores) == 2


def test_no_object_has_no_precision() -> None:
    scored = score([_found(scores=[])], [_labels()], 0)
    assert np.isnan(scored.average_precision())
    assert np.isnan(scored.recall(0.5))
