"""Landmarks that stand near each other: the part of a search index that is found once and kept with a large map."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.model import LandmarkMap

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Ints = NDArray[np.int64]
Rows = NDArray[np.int32]

# Every landmark takes part in triangles with so many of its nearest; small maps index all of theirs.
_NEAREST = 5
SMALL_MAP = 200_000
"""Triangles that a small map may have."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """Triangles (T, 3) and pairs (P, 2) of N landmarks by their places in the list of these.

    Triangles run counter-clockwise from the corner where their classes read lowest, pairs from the lower class.
    """

    triangles: Rows
    pairs: Rows

    @classmethod
    def of_map(cls, landmark_map: LandmarkMap) -> "Neighbours":
        """Of the confirmed landmarks of a map."""
        from scipy.spatial import cKDTree  # noqa: PLC0415 - takes a third of a second, and most verbs need none

        rows, _, class_of = confirmed(landmark_map)
        positions = landmark_map.positions_xy[rows]
        return cls.of(cKDTree(positions, balanced_tree=False), positions, class_of)

    @classmethod
    def of(cls, places: "cKDTree", positions_xy: Array, class_of: Ints) -> "Neighbours":
        """Of landmarks at positions (N, 2), which the tree `places` holds, with class numbers (N,)."""
        near = _neighbours(places, positions_xy)
        return cls(_canonical(_triangles(near), positions_xy, class_of), _pairs(near, class_of))


def confirmed(landmark_map: LandmarkMap) -> tuple[Ints, tuple[str, ...], Ints]:
    """Rows (N,) of the confirmed landmarks of a map, the names of their classes, and which (N,) of these each has."""
    rows = np.flatnonzero(~landmark_map.tentative)
    classes = [landmark_map.classes[i] for i in rows.tolist()]
    names = sorted(set(classes))
    number = {name: i for i, name in enumerate(names)}
    return rows, tuple(names), np.fromiter(map(number.__getitem__, classes), dtype=np.int64, count=len(classes))


def _neighbours(places: "cKDTree", positions: Array) -> Ints:
    """The nearest landmarks (N, K) of each, nearest first."""
    n = len(positions)
    count = min(n - 1, max(_NEAREST, int(np.sqrt(2 * SMALL_MAP / n))))
    near = np.asarray(places.query(positions, k=np.arange(1, count + 2), workers=2)[1], dtype=np.int64)
    own = near == np.arange(n)[:, None]
    own[~own.any(axis=1), -1] = True  # landmarks in one place can push a landmark off its own list
    others: Ints = near[~own].reshape(n, count)
    return others


def _pairs(near: Ints, class_of: Ints) -> Rows:
    """Each pair of neighbours once, lower class first."""
    n, count = near.shape
    a, b = np.repeat(np.arange(n), count), near.ravel()
    keep = (a < b) | ~(near[b] == a[:, None]).any(axis=1)
    pairs = np.stack([a[keep], b[keep]], axis=1)
    swap = class_of[pairs[:, 0]] > class_of[pairs[:, 1]]
    return np.where(swap[:, None], pairs[:, ::-1], pairs).astype(np.int32)


def _triangles(near: Ints) -> Rows:
    """Corners (3, T): each landmark with any two of its neighbours; those found from several corners once."""
    n, count = near.shape
    near = near.astype(np.int32)
    own = np.arange(n, dtype=np.int32)
    # A neighbour of lower number that lists this landmark too has the triangle, if it lists the third one as well.
    first = [(near[near[:, i]] == own[:, None]).any(axis=1) & (near[:, i] < own) for i in range(count)]
    parts = []
    for i, j in zip(*np.triu_indices(count, 1), strict=True):
        b, c = near[:, i], near[:, j]
        has = np.zeros(n, dtype=np.bool_)
        for corner, third, rows in ((b, c, np.flatnonzero(first[i])), (c, b, np.flatnonzero(first[j]))):
            has[rows] |= (near[corner[rows]] == third[rows, None]).any(axis=1)
        parts.append(np.stack([own, b, c])[:, ~has])
    return np.concatenate(parts, axis=1) if parts else np.zeros((3, 0), dtype=np.int32)


def _canonical(corners: Rows, positions: Array, class_of: Ints) -> Rows:
    """Triangles (T, 3) counter-clockwise, from the corner where the classes read lowest."""
    (ax, bx, cx), (ay, by, cy) = (coordinate[corners] for coordinate in positions.T.copy())
    left = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) >= 0
    a, b, c = corners[0], np.where(left, corners[1], corners[2]), np.where(left, corners[2], corners[1])
    count = int(class_of.max()) + 1
    p, q, r = class_of[a], class_of[b], class_of[c]
    from_a, from_b, from_c = (p * count + q) * count + r, (q * count + r) * count + p, (r * count + p) * count + q
    at_a = (from_a <= from_b) & (from_a <= from_c)
    at_b = from_b <= from_c
    turned = [np.where(at_a, u, np.where(at_b, v, w)) for u, v, w in ((a, b, c), (b, c, a), (c, a, b))]
    return np.stack(turned, axis=1)
