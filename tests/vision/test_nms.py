"""Non-maximum suppression against plain loops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.vision.nms import suppress

from tests.vision.reference import greedy


def check(boxes: np.ndarray, scores: np.ndarray, classes: np.ndarray, iou: float, most: int) -> None:
    kept = suppress(boxes, scores, classes, iou, most)
    plain = greedy([(*b, s, int(c)) for b, s, c in zip(boxes, scores, classes, strict=True)], iou, most)
    np.testing.assert_array_equal(boxes[kept], np.array([entry[:4] for entry in plain], np.float32).reshape(-1, 4))
    np.testing.assert_array_equal(scores[kept], np.array([entry[4] for entry in plain], np.float32))
    assert classes[kept].tolist() == [entry[5] for entry in plain]


@pytest.mark.parametrize("seed", range(20))
def test_random_boxes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 400))
    corners = rng.uniform(0, 200, (count, 2))
    boxes = np.hstack([corners, corners + rng.uniform(5, 90, (count, 2))]).astype(np.float32)
    scores = rng.choice(rng.random(count), count).astype(np.float32)  # some are equal
    check(boxes, scores, rng.integers(0, 3, count), float(rng.uniform(0.1, 0.9)), int(rng.integers(1, 100)))


numbers = st.integers(0, 12)


@pytest.mark.slow
@given(st.lists(st.tuples(numbers, numbers, numbers, numbers, numbers, st.integers(0, 1)), max_size=12))
def test_small_grids_with_ties_and_empty_boxes(entries: list[tuple[int, ...]]) -> None:
    rows = np.array(entries, dtype=np.float32).reshape(-1, 6)
    boxes = np.hstack([rows[:, :2], rows[:, :2] + rows[:, 2:4]])
    check(boxes, rows[:, 4] / 12, rows[:, 5].astype(np.intp), 0.45, 300)


def test_classes_do_not_touch_each_other() -> None:
    boxes = np.tile(np.array([[0, 0, 10, 10]], np.float32), (3, 1))
    kept = suppress(boxes, np.array([0.5, 0.9, 0.7], np.float32), np.array([0, 1, 0]), 0.45, 300)
    assert kept.tolist() == [1, 2]


def test_nothing_gives_nothing() -> None:
    assert len(suppress(np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.intp), 0.45, 10)) == 0
