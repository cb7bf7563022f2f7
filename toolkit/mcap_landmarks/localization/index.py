"""Search index of a landmark map: class-labelled pairs and triangles by their side lengths, in k-d trees."""

from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcap_landmarks.localization.validation import check_map
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.neighbours import SMALL_MAP, Neighbours, confirmed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Classes are one more coordinate of the trees, so far apart (in metres, as the sides) that no tolerance, which is cut
# at the widest, reaches over.
_APART = 1e3
_WIDEST = 400.0
# Numbers up to here are ranked by counting: an array of so many costs 8 MB, and less time than sorting.
_SMALL = 10**6
# Groups whose sides are measured at once: their corners fit into a second-level cache.
_AT_ONCE = 20_000


class _Triangles(NamedTuple):
    """A tree over the sides of triangles, and the numbers of class triples that its last coordinate counts."""

    tree: cKDTree
    keys: Ints

    @classmethod
    def of(cls, sides: Array, numbers: Ints) -> "_Triangles":
        keys, place = _ranks(numbers)
        points = np.empty((len(sides), 4))
        points[:, :3], points[:, 3] = sides, place * _APART
        return cls(cKDTree(points, 32, balanced_tree=False, compact_nodes=False), keys)

    def near(self, sides: Array, numbers: Ints, tolerance: Array) -> tuple[Ints, Ints]:
        """Which of Q queries (M,) each found triangle (M,) belongs to."""
        if not len(sides) or not len(self.keys):
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        place = np.minimum(np.searchsorted(self.keys, numbers), len(self.keys) - 1)
        known = np.flatnonzero(self.keys[place] == numbers)
        points = np.column_stack([sides[known], place[known] * _APART])
        radius = np.minimum(tolerance[known], _WIDEST)
        lists = self.tree.query_ball_point(points, radius, p=np.inf, workers=2)
        counts = np.fromiter(map(len, lists), dtype=np.int64, count=len(lists))
        member = np.fromiter(chain.from_iterable(lists), dtype=np.int64, count=int(counts.sum()))
        return np.repeat(known, counts), member


class _Pairs(NamedTuple):
    """Pairs by class pair and length: class pairs lie so far apart on one line that no tolerance reaches over."""

    place: Array
    member: Ints
    step_m: float
    class_pairs: int

    @classmethod
    def of(cls, lengths: Array, numbers: Ints) -> "_Pairs":
        step_m = 4 * float(lengths.max(initial=1.0))
        place = numbers * step_m + lengths
        member = np.argsort(place, kind="stable")
        class_pairs = int(np.count_nonzero(np.diff(numbers[member]))) + (len(member) > 0)
        return cls(place[member], member, step_m, class_pairs)

    def near(self, lengths: Array, numbers: Ints, tolerance: Array, most: int) -> tuple[Ints, Ints]:
        """Which of Q queries (M,) each found pair (M,) belongs to; those that find more than `most` find none."""
        place = numbers * self.step_m
        length, reach = np.minimum(lengths, self.step_m / 2), np.minimum(tolerance, self.step_m / 4)
        first = np.searchsorted(self.place, place + length - reach)
        count = np.searchsorted(self.place, place + length + reach, side="right") - first
        count[count > most] = 0
        query = np.repeat(np.arange(len(lengths)), count)
        within = np.arange(len(query)) - np.repeat(np.cumsum(count) - count, count)
        return query, self.member[first[query] + within]


class Hits(NamedTuple):
    """What was found: of which query, and the landmarks (M, 2 or 3) in the order of the query's objects."""

    query: Ints
    landmarks: Ints


@dataclass(frozen=True, slots=True, eq=False)
class MapIndex:
    """N landmarks of a map by position, and their pairs and triangles by class and side lengths.

    `rows` (N,) are the landmarks' places in the map: tentative ones are left out. `class_of` (N,) numbers `names`.
    `extent_m` is the distance of the nearest two that are not in one place, and the diagonal of the box around all.
    Triangles are stored counter-clockwise and so told from their mirror images; groups of four and five objects are
    found by any of their triangles.
    """

    landmark_map: LandmarkMap
    rows: Ints
    names: tuple[str, ...]
    class_of: Ints
    positions_xy: Array
    covariances: Array
    extent_m: tuple[float, float]
    places: cKDTree
    triangles: NDArray[np.int32]
    pairs: NDArray[np.int32]
    _by_sides: _Triangles
    _by_length: _Pairs

    @classmethod
    def build(cls, landmark_map: LandmarkMap, neighbours: Neighbours | None = None) -> "MapIndex":
        """Index of the confirmed landmarks, whose neighbours may be known already.

        Raises:
            MapError: the map is not fit to localize in, see `check_map`.
        """
        check_map(landmark_map)
        rows, names, class_of = confirmed(landmark_map)
        positions = landmark_map.positions_xy[rows]
        places = cKDTree(positions, balanced_tree=False)
        near = neighbours or Neighbours.of(places, positions, class_of)
        lengths = _lengths(positions, near.pairs)[:, 0]
        return cls(
            landmark_map,
            rows,
            names,
            class_of,
            positions,
            landmark_map.covariances[rows],
            _extent(lengths, positions),
            places,
            near.triangles,
            near.pairs,
            _Triangles.of(_lengths(positions, near.triangles), _number(class_of[near.triangles], len(names))),
            _Pairs.of(lengths, _number(class_of[near.pairs], len(names))),
        )

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def class_pair_count(self) -> int:
        """How many different pairs of classes there are."""
        return self._by_length.class_pairs

    @property
    def small(self) -> bool:
        """Whether the map is so small that looking for unlikely classes as well costs little."""
        return len(self.triangles) <= SMALL_MAP

    def find_triangles(self, sides: Array, classes: Ints, tolerance: Array) -> Hits:
        """Triangles like counter-clockwise ones of such sides (Q, 3), 01, 12, 20, and classes (Q, 3).

        No side differs by more than `tolerance` (Q,).
        """
        turn = first_corner(classes, len(self.names))
        same = (classes == classes[:, :1]).all(axis=1)
        # A triangle of one class may have been stored from any of its corners.
        query = np.concatenate([np.arange(len(sides)), np.repeat(np.flatnonzero(same), 2)])
        turn = np.concatenate([turn, np.tile([1, 2], int(same.sum()))])
        order = (turn[:, None] + np.arange(3)) % 3
        number = _number(np.take_along_axis(classes[query], order, axis=1), len(self.names))
        turned = np.take_along_axis(sides[query], order, axis=1)
        found, member = self._by_sides.near(turned, number, tolerance[query])
        landmarks = np.empty((len(found), 3), dtype=np.int64)
        np.put_along_axis(landmarks, order[found], self.triangles[member].astype(np.int64), axis=1)
        return Hits(query[found], landmarks)

    def find_pairs(self, lengths: Array, classes: Ints, tolerance: Array, most: int) -> Hits:
        """Pairs as far apart as `lengths` (Q,) give or take `tolerance` (Q,), of such classes (Q, 2).

        What fits more than `most` of the map's pairs finds none.
        """
        swap = classes[:, 0] > classes[:, 1]
        both = classes[:, 0] == classes[:, 1]
        query = np.concatenate([np.arange(len(lengths)), np.flatnonzero(both)])
        swap = np.concatenate([swap, np.ones(int(both.sum()), dtype=np.bool_)])
        number = _number(np.sort(classes[query], axis=1), len(self.names))
        found, member = self._by_length.near(lengths[query], number, tolerance[query], most)
        landmarks = self.pairs[member].astype(np.int64)
        return Hits(query[found], np.where(swap[found, None], landmarks[:, ::-1], landmarks))


def side_lengths(points: Array) -> Array:
    """Lengths (..., K) from each of K points (..., K, 2) to the next, the last to the first."""
    along = points - np.roll(points, -1, axis=-2)
    lengths: Array = np.sqrt(along[..., 0] ** 2 + along[..., 1] ** 2)  # a norm along two numbers takes thrice the time
    return lengths


def first_corner(classes: Ints, count: int) -> Ints:
    """Which corner of triangles (Q, 3) comes first in the index: the one from which the classes read lowest."""
    first: Ints = np.stack([_number(np.roll(classes, -r, axis=1), count) for r in range(3)], axis=1).argmin(axis=1)
    return first


def _number(classes: Ints, count: int) -> Ints:
    number = classes[:, 0]
    for column in classes.T[1:]:
        number = number * count + column
    return number


def _ranks(numbers: Ints) -> tuple[Ints, Ints]:
    """As `numpy.unique` with its inverse, without sorting where the numbers are small."""
    if numbers.max(initial=0) > _SMALL:
        keys, place = np.unique(numbers, return_inverse=True)
        return keys, place
    keys = np.flatnonzero(np.bincount(numbers))
    rank = np.zeros(numbers.max(initial=0) + 1, dtype=np.int64)
    rank[keys] = np.arange(len(keys))
    return keys, rank[numbers]


def _lengths(positions: Array, corners: NDArray[np.int32]) -> Array:
    """As `side_lengths` (T, S) of groups (T, S) of positions, of which there are many: some at once, for the cache."""
    lengths = np.empty(corners.shape)
    for first in range(0, len(corners), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        lengths[part] = side_lengths(positions[corners[part]])
    return lengths


def _extent(lengths: Array, positions: Array) -> tuple[float, float]:
    widest = float(np.linalg.norm(np.ptp(positions, axis=0)))
    return float(lengths.min(where=lengths > 0, initial=widest)), widest
