"""Candidate poses of a bundle anywhere in the map, from its pairs and triangles of objects.

This and `verification` find the maximum clique over pairwise consistency (Bailey 2002, Mangelson et al. 2018): take
the pairs (object, landmark) as nodes, with an edge where distances agree. A clique of three nodes or more holds a
triangle of objects that is like one of the map, and any of its triangles tells the pose under which the verifier finds
all the rest of it. So no search over subsets is needed, only a triangle out of every clique. Objects are cut into
sectors of eight at most, all of whose triangles are looked up: of up to 8 objects no triangle is missed, of up to 16
any five have three in one sector, of up to 24 any seven (what matches less than half of a bundle is not accepted
anyway). So the work is bounded without a clock, and the answer the same on any machine. The verifier goes by the joint
chi-square, which pairwise distances only approximate and which tells a clique from its mirror image.

Exact is this where the index holds all triangles of the map (up to a hundred landmarks). Larger maps keep those of near
landmarks, so there a clique needs one such; triangles of near objects, added for more than eight, are likeliest to be.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mcap_landmarks.estimation import procrustes
from mcap_landmarks.localization.index import MapIndex, side_lengths
from mcap_landmarks.localization.verification import UNMATCHED, Candidates, Constellations

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# All triangles of so many objects are looked up, 56 of them; of more objects those within sectors, and those of an
# object with two of so many near ones.
_SECTOR = 8
_NEAR = 4
# Objects clearly beside each other are so many standard deviations apart: nearer ones may be one that was split.
_CLEARLY = 5.0
# Groups that leave the heading more open than this are no start: the verifier's steps turn little more (`_STEP_RAD`).
_HEADING_RAD = 0.2
# Of the sides of true triangles one set in 2000 lies beyond the gate; a box around them, of sigmas each, holds nearly
# all of the ellipsoid that the gate lets pass.
_BOX_SIGMAS = 3.5
_GATE = float(chdtri(3, 0.0005))
# Classes at least so likely, against the likeliest of an object, are looked for too: in small maps, where lookups cost
# little, down to below what `misread` leaves for each of a few classes.
_PLAUSIBLE, _PLAUSIBLE_IN_SMALL = 0.1, 5e-3
# Share of a side's variance that no other side has: without it, sides of three objects exactly in line would have a
# covariance without inverse.
_OWN = 1e-6
# Pairs of the same classes in the whole map, on average, up to which pairs are looked up beside triangles: of so many a
# distance known to a few percent leaves one or two.
_FEW_PAIRS = 20
# A pair that fits in so many places says nothing, and would cost as many verifications.
_MOST_HITS = 500
# Poses so close to one another are tried once: half of what is one place (`matching._SAME_M`).
_SAME_M, _SAME_RAD = 0.25, 0.1


class _Queries(NamedTuple):
    """Groups of objects to look up: of which set, which objects, and the classes to look for, each (Q, ...)."""

    of: Ints
    objects: Ints
    classes: Ints


@dataclass(frozen=True, slots=True)
class PoseCandidates:
    """Looks up groups of objects in a map whose landmarks are known to `map_sigma_m`."""

    index: MapIndex
    map_sigma_m: float

    @property
    def pairs_are_few(self) -> bool:
        """Whether the map has so many classes that pairs are worth looking up beside triangles."""
        return len(self.index.pairs) <= _FEW_PAIRS * self.index.class_pair_count

    def triangles(self, sets: Constellations, fresh: NDArray[np.bool_]) -> Candidates:
        """Candidates from triangles of objects, K >= 3, of those that have a `fresh` one (B, K) among them."""
        queries = self._classes(sets, *_triangles_of(sets, fresh))
        queries, sides, spread = self._oriented(sets, queries)
        sigma = np.sqrt(spread[:, np.arange(3), np.arange(3)].max(axis=1))
        hits = self.index.find_triangles(sides, queries.classes, _BOX_SIGMAS * sigma)
        found = side_lengths(self.index.positions_xy[hits.landmarks]) - sides[hits.query]
        weight = np.linalg.inv(spread)[hits.query]
        fits = (found[:, None] @ weight @ found[..., None])[:, 0, 0]
        keep = fits < _GATE
        return self._candidates(sets, queries, hits.query[keep], hits.landmarks[keep], fits[keep])

    def pairs(self, sets: Constellations, fresh: NDArray[np.bool_]) -> Candidates:
        """Candidates from pairs of objects, K >= 2, of those that have a `fresh` one (B, K) among them."""
        groups = np.tile(_groups(sets.points_xy.shape[1], 2), (len(sets), 1, 1))
        queries = self._classes(sets, *_with_any(groups, fresh))
        lengths, spread = self._sides(sets, queries)
        lengths, variance = lengths[:, 0], spread[:, 0, 0]
        tolerance = _BOX_SIGMAS * np.sqrt(variance)
        hits = self.index.find_pairs(lengths, queries.classes, tolerance, _MOST_HITS)
        found = side_lengths(self.index.positions_xy[hits.landmarks])[:, 0] - lengths[hits.query]
        return self._candidates(sets, queries, hits.query, hits.landmarks, found**2 / variance[hits.query])

    def _classes(self, sets: Constellations, of: Ints, objects: Ints) -> _Queries:
        """Groups of objects (Q, S) wide enough to tell the heading, with the likeliest class of each or one other."""
        wide = self._heading_sigma(sets, of, objects) < _HEADING_RAD
        of, objects = of[wide], objects[wide]
        first = sets.log_ratio.argmax(axis=2)
        top = np.take_along_axis(sets.log_ratio, first[..., None], axis=2)
        other = sets.log_ratio > top + np.log(_PLAUSIBLE_IN_SMALL if self.index.small else _PLAUSIBLE)
        np.put_along_axis(other, first[..., None], values=False, axis=2)
        classes = first[of[:, None], objects]
        parts = [_Queries(of, objects, classes)]
        for place in range(objects.shape[1]):
            row, label = np.nonzero(other[of, objects[:, place]])
            changed = classes[row]
            changed[:, place] = label
            parts.append(_Queries(of[row], objects[row], changed))
        return _Queries(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def _heading_sigma(self, sets: Constellations, of: Ints, objects: Ints) -> Array:
        points = sets.points_xy[of[:, None], objects]
        spread = ((points - points.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2))
        columns = 2 * objects[..., None] + np.arange(2)
        variance = sets.covariance[of[:, None, None], columns, columns].mean(axis=(1, 2)) + self.map_sigma_m**2
        sigma: Array = np.sqrt(variance / np.maximum(spread, 1e-12))
        return sigma

    def _sides(self, sets: Constellations, queries: _Queries) -> tuple[Array, Array]:
        """Side lengths (Q, S) of groups of S objects and their covariance (Q, S, S), the map's share included."""
        points = sets.points_xy[queries.of[:, None], queries.objects]
        sides = side_lengths(points)
        size = queries.objects.shape[1]
        along = (np.roll(points, -1, axis=1) - points) / np.maximum(sides, 1e-9)[..., None]
        jacobian = np.zeros((len(points), size, size, 2))
        place = np.arange(size)
        jacobian[:, place, place] = -along
        jacobian[:, place, (place + 1) % size] += along
        by_point: Array = jacobian.reshape(len(points), size, 2 * size)
        columns = (2 * queries.objects[..., None] + np.arange(2)).reshape(len(points), 2 * size)
        spread = sets.covariance[queries.of[:, None, None], columns[:, :, None], columns[:, None, :]]
        spread = spread + self.map_sigma_m**2 * np.eye(2 * size)
        spread = by_point @ spread @ by_point.swapaxes(1, 2)
        most = spread[:, np.arange(size), np.arange(size)].max(axis=1)
        return sides, spread + _OWN * most[:, None, None] * np.eye(size)

    def _oriented(self, sets: Constellations, queries: _Queries) -> tuple[_Queries, Array, Array]:
        """Triangles counter-clockwise; those too flat to tell also the other way round."""
        corner = sets.points_xy[queries.of[:, None], queries.objects]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        twice_area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        sides, spread = self._sides(sets, queries)
        sigma = np.sqrt(spread[:, np.arange(3), np.arange(3)].max(axis=1))
        flat = np.abs(twice_area) < 3 * sigma * sides.max(axis=1)
        rows = np.concatenate([np.arange(len(corner)), np.flatnonzero(flat)])
        clockwise = np.concatenate([twice_area < 0, twice_area[flat] >= 0])
        corners = np.where(clockwise[:, None], [0, 2, 1], [0, 1, 2])
        sides_of = np.where(clockwise[:, None], [2, 1, 0], [0, 1, 2])
        turned = _Queries(
            queries.of[rows],
            np.take_along_axis(queries.objects[rows], corners, axis=1),
            np.take_along_axis(queries.classes[rows], corners, axis=1),
        )
        spread = spread[rows[:, None, None], sides_of[:, :, None], sides_of[:, None, :]]
        return turned, np.take_along_axis(sides[rows], sides_of, axis=1), spread

    def _candidates(
        self, sets: Constellations, queries: _Queries, query: Ints, landmarks: Ints, fits: Array
    ) -> Candidates:
        """Poses of the hits by closed-form least squares (Procrustes; Umeyama 1991), of those alike the best."""
        of, objects = queries.of[query], queries.objects[query]
        points, places = sets.points_xy[of[:, None], objects], self.index.positions_xy[landmarks]
        x, y, cosine, sine = procrustes.fit(
            places[..., 0].T, places[..., 1].T, points[..., 0].T, points[..., 1].T, np.ones(objects.T.shape)
        )
        pose = np.stack([x, y, np.arctan2(sine, cosine)], axis=-1)
        cells = np.column_stack([of, np.round(pose / [_SAME_M, _SAME_M, _SAME_RAD]).astype(np.int64)])
        order = np.lexsort((fits, *cells.T))
        fresh = np.ones(len(order), dtype=np.bool_)
        fresh[1:] = (np.diff(cells[order], axis=0) != 0).any(axis=1)
        keep = np.sort(order[fresh])
        matched = np.full((len(keep), sets.points_xy.shape[1]), UNMATCHED)
        np.put_along_axis(matched, objects[keep], landmarks[keep], axis=1)
        order = np.argsort(of[keep], kind="stable")
        return Candidates(of[keep][order], pose[keep][order], matched[order])


def _groups(count: int, size: int) -> Ints:
    return np.array(list(combinations(range(count), size)))


def _with_any(groups: Ints, fresh: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    """Of groups (B, G, S) those with a fresh object: of which set (Q,), and the objects (Q, S)."""
    rows = np.arange(len(groups))[:, None, None]
    of, group = np.nonzero(fresh[rows, groups].any(axis=2))
    return of, groups[of, group]


def _triangles_of(sets: Constellations, fresh: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    """Triangles to look up: of which set (Q,), and the objects (Q, 3), one of them fresh."""
    count, k = sets.points_xy.shape[:2]
    if k <= _SECTOR:
        return _with_any(np.tile(_groups(k, 3), (count, 1, 1)), fresh)
    both = np.concatenate([_within_sectors(sets), _of_near(sets)], axis=1)
    of, objects = _with_any(np.sort(both, axis=2), fresh)
    once = np.unique(np.column_stack([of, objects]) @ np.array([k**3, k**2, k, 1]), return_index=True)[1]
    return of[once], objects[once]


def _within_sectors(sets: Constellations) -> Ints:
    """All triangles (B, T, 3) of objects within each of as few sectors around the robot as hold all objects."""
    k = sets.points_xy.shape[1]
    by_bearing = np.argsort(np.arctan2(sets.points_xy[..., 1], sets.points_xy[..., 0]), axis=1, kind="stable")
    sectors = np.array_split(np.arange(k), -(-k // _SECTOR))
    return by_bearing[:, np.concatenate([sector[_groups(len(sector), 3)] for sector in sectors])]


def _of_near(sets: Constellations) -> Ints:
    """Triangles (B, T, 3) of each object with two of its nearest that lie clearly beside it."""
    count, k = sets.points_xy.shape[:2]
    apart = np.linalg.norm(sets.points_xy[:, :, None] - sets.points_xy[:, None], axis=-1)
    variance = sets.covariance[:, np.arange(2 * k), np.arange(2 * k)].reshape(count, k, 2).sum(axis=2)
    apart = np.where(apart < _CLEARLY * np.sqrt(variance)[:, :, None], apart + apart.max(), apart)
    apart[:, np.arange(k), np.arange(k)] = -1.0
    near = np.argsort(apart, axis=2, kind="stable")[:, :, 1 : _NEAR + 1]
    first, second = np.triu_indices(_NEAR, 1)
    own = np.broadcast_to(np.arange(k)[:, None], (count, k, len(first)))
    return np.stack([own, near[:, :, first], near[:, :, second]], axis=-1).reshape(count, -1, 3)
