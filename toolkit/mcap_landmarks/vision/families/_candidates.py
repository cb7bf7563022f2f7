"""Candidates of tables of scores and boxes, as every family makes them in the end."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.family import DetectionCandidates
from mcap_landmarks.vision.letterbox import Boxes


def best_classes(
    scores: NDArray[np.floating], lowest: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Of scores (N, classes): the rows (K,) whose best is above `lowest`, and class and score of these (K,)."""
    # Few rows pass, so that only their classes are looked for.
    rows = np.flatnonzero(scores.max(axis=1, initial=-np.inf) > lowest)
    passed = scores[rows].astype(np.float32)
    class_ids = passed.argmax(axis=1)
    return rows, class_ids, passed[np.arange(len(rows)), class_ids]


def boxes_around(rows: NDArray[np.float32]) -> Boxes:
    """Boxes (N, 4) by their corners of boxes (N, 4) by centre, width and height."""
    centres, halves = rows[:, 0:2], rows[:, 2:4] / 2
    with np.errstate(invalid="ignore", over="ignore"):  # a broken network's numbers are sorted out later
        boxes: Boxes = np.concatenate([centres - halves, centres + halves], axis=1)
    return boxes


def candidates_above(
    boxes_xyxy: Boxes,
    scores: NDArray[np.float32],
    class_ids: NDArray[np.intp],
    thresholds: NDArray[np.float32],
) -> DetectionCandidates:
    """The N boxes whose score is above the threshold of their class (classes,), where all numbers are finite."""
    good = (scores > thresholds[class_ids]) & np.isfinite(boxes_xyxy).all(axis=1) & np.isfinite(scores)
    return DetectionCandidates(boxes_xyxy[good], scores[good], class_ids[good])


def candidates_by_objectness(rows: NDArray[np.float32], thresholds: NDArray[np.float32]) -> DetectionCandidates:
    """Candidates of rows (N, 5 + classes): centre, size, objectness, class probabilities."""
    class_ids = rows[:, 5:].argmax(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):  # a broken network's numbers are sorted out below
        scores = rows[:, 4] * rows[np.arange(len(rows)), 5 + class_ids]
    return candidates_above(boxes_around(rows[:, :4]), scores, class_ids, thresholds)


def candidates_of_classes(
    boxes_xyxy: Boxes, scores: NDArray[np.float32], class_ids: NDArray[Any], thresholds: NDArray[np.float32]
) -> DetectionCandidates:
    """The same where the network chose the classes (N,) itself: numbers that are none of ours are left out."""
    known = (class_ids >= 0) & (class_ids < len(thresholds))
    return candidates_above(boxes_xyxy[known], scores[known], class_ids[known].astype(np.intp), thresholds)
