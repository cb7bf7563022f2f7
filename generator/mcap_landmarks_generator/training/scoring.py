"""How good detections are: average precision, recall by distance, precision and false images, against labels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.training.pictures import Labels

Floats = NDArray[np.float64]

_RECALLS = np.linspace(0, 1, 101)
_OVERLAP = 0.5
# What shows less than half of an object may be found or not.
_LEAST_SHARE, _LEAST_SIDE_PX = 0.5, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a detector found in one image: boxes_xyxy (N, 4), scores (N,), COCO ids (N,)."""

    boxes_xyxy: Floats
    scores: Floats
    classes: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """All images' detections of one class, and what became of them.

    scores (N,); hits (N,) and excused (N,): whether each found an object, or is neither right nor wrong. Of the M
    objects that count, found_at (M,) is the score at which each was found (0 if never), distances_m (M,) how far.
    """

    scores: Floats
    hits: NDArray[np.bool_]
    excused: NDArray[np.bool_]
    found_at: Floats
    distances_m: Floats

    def average_precision(self) -> float:
        """Area under precision over recall, at 101 recalls; NaN where there is no object."""
        if not len(self.found_at):
            return float("nan")
        counted = ~self.excused
        order = np.argsort(-self.scores[counted], kind="stable")
        hits = self.hits[counted][order]
        recall = np.cumsum(hits) / len(self.found_at)
        precision = np.cumsum(hits) / np.arange(1, len(hits) + 1)
        best = np.maximum.accumulate(precision[::-1])[::-1] if len(hits) else precision
        place = np.searchsorted(recall, _RECALLS)
        return float(np.mean(np.append(best, 0.0)[np.minimum(place, len(best))]))

    def recall(self, threshold: float, nearest_m: float = 0.0, farthest_m: float = np.inf) -> float:
        """Share of the objects at a distance that were found above a threshold; NaN where there are none."""
        within = (self.distances_m >= nearest_m) & (self.distances_m < farthest_m)
        return float(np.mean(self.found_at[within] > threshold)) if within.any() else float("nan")

    def precision(self, threshold: float) -> float:
        """Share of the detections above a threshold that are right; NaN where there are none."""
        counted = (self.scores > threshold) & ~self.excused
        return float(np.mean(self.hits[counted])) if counted.any() else float("nan")


def joined(parts: Sequence[Scored]) -> Scored:
    """Several classes as one."""
    return Scored(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("scores", "hits", "excused", "found_at", "distances_m")
        )
    )


def score(found: Sequence[Found], labels: Sequence[Labels], coco_id: int) -> Scored:
    """Match one class's detections to its objects, image by image, best first, by an overlap (IoU) above one half."""
    rows = [_score_image(one, truth, coco_id) for one, truth in zip(found, labels, strict=True)]
    return joined(rows)


def _score_image(found: Found, labels: Labels, coco_id: int) -> Scored:
    mine = found.classes == coco_id
    order = np.argsort(-found.scores[mine], kind="stable")
    boxes, scores = found.boxes_xyxy[mine][order], found.scores[mine][order]
    of_class = labels.classes == coco_id
    sides = labels.boxes_xyxy[:, 2:] - labels.boxes_xyxy[:, :2]
    counts = (labels.shares[of_class] >= _LEAST_SHARE) & (sides[of_class].min(axis=1) > _LEAST_SIDE_PX)
    overlap = iou(boxes, labels.boxes_xyxy[of_class])
    found_at = np.zeros(int(of_class.sum()))
    hits, excused = np.zeros(len(boxes), bool), np.zeros(len(boxes), bool)
    for i in range(len(boxes)):
        free = np.where(found_at > 0, -1.0, overlap[i])
        if len(free) and free.max() > _OVERLAP:
            best = int(np.argmax(free))
            found_at[best] = scores[i]
            hits[i], excused[i] = counts[best], not counts[best]
        elif len(free) and overlap[i][~counts].max(initial=0.0) > 0:
            excused[i] = True  # part of something that hardly shows
    return Scored(scores, hits, excused, found_at[counts], labels.distances_m[of_class][counts])


def iou(a: Floats, b: Floats) -> Floats:
    """Overlap (N, M) of boxes (N, 4) with boxes (M, 4), corners each."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=2)
    area_a, area_b = (a[:, 2:] - a[:, :2]).prod(axis=1), (b[:, 2:] - b[:, :2]).prod(axis=1)
    union: Floats = area_a[:, None] + area_b[None] - shared
    return np.asarray(shared / np.maximum(union, 1e-9))
