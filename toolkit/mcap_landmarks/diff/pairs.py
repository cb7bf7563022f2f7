"""Which message, detection, object or landmark of a candidate is which of the baseline."""

from collections import defaultdict
from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mcap_landmarks.diff.values import Array, Rows, spans

NEAR_M = 1.0
"""Objects of one message that stand farther apart than this are different ones."""
LEAST_OVERLAP = 0.3
"""Boxes of one image that overlap less than this (intersection over union) are different ones."""


class Pairs(NamedTuple):
    """Rows (K,) of both sides that belong together, and the rows of each side that are left."""

    baseline: Rows
    candidate: Rows
    removed: Rows
    added: Rows


def pair_keys(baseline: Sequence[Hashable], candidate: Sequence[Hashable]) -> Pairs:
    """Rows with equal keys; of several the first with the first, the second with the second."""
    waiting: dict[Hashable, list[int]] = defaultdict(list)
    for row in reversed(range(len(baseline))):
        waiting[baseline[row]].append(row)
    mine, theirs = [], []
    for row, key in enumerate(candidate):
        if waiting.get(key):
            mine.append(waiting[key].pop())
            theirs.append(row)
    return _pairs(mine, theirs, len(baseline), len(candidate))


def pair_points(
    messages: tuple[Rows, Rows], points: tuple[Array, Array], classes: tuple[NDArray[np.object_], NDArray[np.object_]]
) -> Pairs:
    """Objects of the same message within `NEAR_M` of each other, preferably of one class, the nearest together.

    `messages` (N,) and (M,) number the message of each, `points` are (N, 2) and (M, 2), `classes` (N,) and (M,).
    """
    usable = [np.flatnonzero(np.isfinite(side).all(axis=1)) for side in points]
    # messages become layers of a third dimension, too far apart to be near each other
    placed = [
        np.column_stack([side[rows], number[rows] * (4 * NEAR_M)])
        for side, rows, number in zip(points, usable, messages, strict=True)
    ]
    if not all(len(rows) for rows in usable):
        return _pairs([], [], len(points[0]), len(points[1]))
    near = cKDTree(placed[0]).sparse_distance_matrix(cKDTree(placed[1]), NEAR_M, output_type="ndarray")
    mine, theirs = usable[0][near["i"]], usable[1][near["j"]]
    gain = 1.0 - near["v"] / NEAR_M / 2 + (classes[0][mine] == classes[1][theirs])
    return _assigned(mine, theirs, gain, len(points[0]), len(points[1]))


def pair_boxes(
    counts: tuple[Rows, Rows], boxes: tuple[Array, Array], classes: tuple[NDArray[np.object_], NDArray[np.object_]]
) -> Pairs:
    """Boxes xyxy (N, 4) and (M, 4) of the same message that overlap, preferably of one class, the most first.

    `counts` say how many of the boxes each message has.
    """
    starts = [np.cumsum(side) - side for side in counts]
    mine = np.repeat(np.arange(len(boxes[0])), np.repeat(counts[1], counts[0]))
    theirs = spans(np.repeat(starts[1], counts[0]), np.repeat(counts[1], counts[0]))
    overlap = _overlap(boxes[0][mine], boxes[1][theirs])
    keep = overlap >= LEAST_OVERLAP
    mine, theirs = mine[keep], theirs[keep]
    gain = overlap[keep] + (classes[0][mine] == classes[1][theirs])
    return _assigned(mine, theirs, gain, len(boxes[0]), len(boxes[1]))


def _overlap(a: Array, b: Array) -> Array:
    """Intersection over union (K,) of boxes (K, 4); boxes without any area overlap where they are equal."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sides = np.clip(np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2]), 0, None)
        shared = sides.prod(axis=1)
        share = shared / ((a[:, 2:] - a[:, :2]).prod(axis=1) + (b[:, 2:] - b[:, :2]).prod(axis=1) - shared)
    found: Array = np.where((a == b).all(axis=1), 1.0, np.nan_to_num(share))
    return found


def _assigned(mine: Rows, theirs: Rows, gain: Array, count: int, other: int) -> Pairs:
    """The assignment of greatest gain over possible pairs (P,): most pairs are the only ones that their rows have."""
    graph = coo_array((np.ones(len(mine)), (mine, theirs + count)), shape=(count + other, count + other))
    part = connected_components(graph, directed=False)[1][mine]
    alone = np.bincount(part, minlength=1)[part] == 1 if len(part) else np.zeros(0, dtype=np.bool_)
    left, right = mine[alone].tolist(), theirs[alone].tolist()
    rest = np.flatnonzero(~alone)
    rest = rest[np.argsort(part[rest], kind="stable")]
    for edges in np.split(rest, np.flatnonzero(np.diff(part[rest])) + 1):
        rows, row = np.unique(mine[edges], return_inverse=True)
        columns, column = np.unique(theirs[edges], return_inverse=True)
        gains = np.zeros((len(rows), len(columns)))
        gains[row, column] = gain[edges]
        best = linear_sum_assignment(gains, maximize=True)
        kept = gains[best] > 0
        left.extend(rows[best[0][kept]].tolist())
        right.extend(columns[best[1][kept]].tolist())
    return _pairs(left, right, count, other)


def _pairs(mine: Sequence[int], theirs: Sequence[int], count: int, other: int) -> Pairs:
    left, right = np.array(mine, dtype=np.int64), np.array(theirs, dtype=np.int64)
    order = np.argsort(left, kind="stable")
    return Pairs(
        left[order],
        right[order],
        np.setdiff1d(np.arange(count), left),
        np.setdiff1d(np.arange(other), right),
    )
