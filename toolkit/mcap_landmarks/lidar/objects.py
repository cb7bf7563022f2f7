"""Segments to objects: which of them belong together, what each could be, and where its centre is then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array, rotation
from mcap_landmarks.lidar.beams import Beams
from mcap_landmarks.lidar.cells import Noise
from mcap_landmarks.lidar.centre_posteriors import centres
from mcap_landmarks.lidar.segments import Cluster, extent_m, gap_m, hits_of, points_of
from mcap_landmarks.lidar.shape_table import shape_table
from mcap_landmarks.lidar.shapes import Shape
from mcap_landmarks.lidar.windows import windows

_NONE = 0.1
"""How likely something is of no known shape, before anyone looks."""
_OTHER = 0.1
"""How likely something of a class is not of the class's shapes."""
_CRACK_M = 0.35
"""Segments that are no farther apart can be of one solid thing, whose hits between them were lost."""
_LOG_PER_M2 = -3.7
"""Logarithm of objects per square metre where there are any: two side by side are less likely than one of two parts."""
_FAR_M, _SURELY = 0.45, 4.0
"""Clusters farther apart become one only where the logarithm of the evidence gains more than this, not just any."""
_MOST_PAIRS = 600
"""So many pairs of clusters are looked at in a scan at most, the nearest first: three times what real scans had (175
of a Neato among furniture, 107 in a hall of people, leg_tracker's). In a scan of noise every cluster is near every
other, which took 18 s and gigabytes."""
_TOGETHER = 256
"""So many clusters are explained at a time, which bounds the memory."""
_UNKNOWN_M = 0.5
"""Hits of something of no known shape lie anywhere within so many metres along the view."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """What one object could be: names (K,), shares (K,) that sum to 1, positions_xy (K, 2) and covariances (K, 2, 2).

    Most likely first, and at last the bare surface, whose name is empty. `extent_m`: the largest distance of its hits.
    """

    names: tuple[str, ...]
    shares: Array
    positions_xy: Array
    covariances: Array
    extent_m: float


@dataclass(frozen=True, slots=True, eq=False)
class _Explained:
    """A cluster under H shapes: log_evidence (H + 1,), the last one for none of them, positions (H, 2), (H, 2, 2).

    `total` is the logarithm of the evidence for one object here; of two that are joined, for one of known shape.
    `spacing_m`: the distance of neighbouring beams there.
    """

    log_evidence: Array
    positions_xy: Array
    covariances: Array
    total: float
    spacing_m: float


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Two clusters that could be one, the joint one, their distance, and which shapes (S,) could be of such two."""

    first: Cluster
    second: Cluster
    both: Cluster
    gap_m: float
    shapes: NDArray[np.bool_]


def objects(
    beams: Beams, clusters: Sequence[Cluster], shapes: Mapping[str, Sequence[Shape]], noise: Noise
) -> list[Hypotheses]:
    """The objects of a scan, each with every class of `shapes` that it could be, by name with the shapes of a class.

    Neighbouring clusters make one object where that explains them better than an object each: the legs of a person, a
    box and its far corner, or what two LiDARs see of one thing.
    """
    named = _named(shapes)
    explain = _Explainer(beams, named, _priors(shapes), noise)
    joined = _joined(beams, clusters, explain)
    return [
        _ranked([name for name, _ in named], explained, beams, cluster, noise)
        for cluster, explained in zip(joined, explain(joined), strict=True)
    ]


def evidence(beams: Beams, clusters: Sequence[Cluster], shapes: Mapping[str, Sequence[Shape]], noise: Noise) -> float:
    """The logarithm of how likely a noise makes the hits of clusters, each taken for an object."""
    explain = _Explainer(beams, _named(shapes), _priors(shapes), noise)
    return sum(one.total for one in explain(clusters))


def _named(shapes: Mapping[str, Sequence[Shape]]) -> list[tuple[str, Shape]]:
    return [(name, shape) for name, options in shapes.items() for shape in options]


def _priors(shapes: Mapping[str, Sequence[Shape]]) -> Array:
    classes = [options for options in shapes.values() if options]
    share = [(1 - _NONE) / len(classes) / len(options) for options in classes for _ in options]
    return np.array([*share, _NONE if classes else 1.0])


@cache
def _parts_m(shape: Shape) -> tuple[float, float]:
    """The distance of neighbouring parts of the shape, at most, and the radius of the largest; 0 for a single part."""
    if shape.apart_m is not None:
        return shape.apart_m[1], shape.discs[0][2]
    parts = [(x, y, radius) for x, y, radius in shape.discs]
    parts += [(x, y, np.hypot(length, width) / 2) for x, y, length, width in shape.boxes]
    if len(parts) < 2:
        return 0.0, 0.0
    places = np.array([part[:2] for part in parts])
    apart = np.hypot(*(places[:, None] - places).T)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min(axis=1).max()), max(part[2] for part in parts)


class _Explainer:
    """Explains clusters, each but once."""

    def __init__(self, beams: Beams, named: Sequence[tuple[str, Shape]], priors: Array, noise: Noise) -> None:
        self._beams, self._noise = beams, noise
        self._shapes = list(dict.fromkeys(shape for _, shape in named))
        self._row = np.array([self._shapes.index(shape) for _, shape in named], dtype=np.intp)
        self._log_priors = np.log(priors)
        reach_m = shape_table(self._shapes).reach_m
        self._across_m = 2 * reach_m
        self._parts_m = np.array([_parts_m(shape) for shape in self._shapes]).reshape(-1, 2)
        # Where a shape does not fit, its centre is still about there.
        self._vague_m2 = (0.1 * reach_m[self._row] + 0.02) ** 2
        self._known: dict[Cluster, _Explained] = {}

    @property
    def widest_m(self) -> float:
        """The widest gap that any shape has between two segments."""
        return float(self._across_m.max(initial=0.0))

    def bridging(self, gap_m: float, widths_m: tuple[float, float], is_one_view: bool) -> NDArray[np.bool_]:
        """Which shapes (S,) can have two clusters of some widths so far apart, seen by one LiDAR or one each by two.

        Separate parts of a shape have their distance, and a segment is no wider than one of them; pieces of one part
        are near each other, or seen from different sides.
        """
        apart, part = self._parts_m.T
        separate = (gap_m <= apart + part) & (gap_m >= apart - 2 * part) & (min(widths_m) <= 2 * part + _CRACK_M / 4)
        pieces = (gap_m <= _CRACK_M or not is_one_view) & (self._across_m >= gap_m)
        return np.asarray((apart > 0) & separate | pieces)

    def __call__(self, clusters: Sequence[Cluster], pairs: Sequence[_Pair] = ()) -> list[_Explained]:
        """Clusters, each with all shapes, or pairs with those that can be of two segments."""
        asked = [*dict.fromkeys(clusters), *(pair.both for pair in pairs)]
        new = [i for i, cluster in enumerate(asked) if cluster not in self._known]
        if new:
            allowed = np.ones((len(asked), len(self._shapes)), dtype=np.bool_)
            for i, pair in enumerate(pairs, len(asked) - len(pairs)):
                allowed[i] = pair.shapes
            for start in range(0, len(new), _TOGETHER):
                some = new[start : start + _TOGETHER]
                self._explain([asked[i] for i in some], allowed[some])
        return [self._known[cluster] for cluster in (*clusters, *(pair.both for pair in pairs))]

    def _explain(self, clusters: Sequence[Cluster], allowed: NDArray[np.bool_]) -> None:
        window = windows(self._beams, clusters)
        found = centres(window, self._shapes, self._noise, allowed)
        nothing = (np.log(window.spacing_m) - (window.hits - 1) * np.log(_UNKNOWN_M))[:, None]
        shaped = found.log_evidence[:, self._row] + np.log(1 - _OTHER)
        other = np.where(np.isfinite(shaped), np.log(_OTHER) + nothing, -np.inf)
        either = np.logaddexp(shaped, other)
        vague = np.exp(other - np.where(np.isfinite(either), either, 0.0)) * self._vague_m2
        evidence = np.hstack([either, nothing]) + self._log_priors
        of_any: Array = np.logaddexp.reduce(evidence, axis=1)
        of_shapes: Array = np.logaddexp.reduce(shaped + self._log_priors[:-1], axis=1, initial=-np.inf)
        total = np.where(allowed.all(axis=1), of_any, of_shapes) + _LOG_PER_M2
        positions = found.positions_xy[:, self._row]
        covariances = found.covariances[:, self._row] + vague[..., None, None] * np.eye(2)
        for i, cluster in enumerate(clusters):
            self._known[cluster] = _Explained(
                evidence[i], positions[i], covariances[i], float(total[i]), float(window.spacing_m[i])
            )


def _is_one_view(first: Cluster, second: Cluster) -> bool:
    return bool({one.sweep for one in first} & {one.sweep for one in second})


def _surface(beams: Beams, hits: NDArray[np.int64], spacing_m: float, noise: Noise) -> tuple[Array, Array]:
    """The point in the middle of what a scan sees of an object by its hits (N,), and its covariance."""
    points = beams.points_at(hits)
    mean = points.mean(axis=0)
    away = mean - beams.origins_xy[hits].mean(axis=0)
    frame = rotation(np.arctan2(away[1], away[0]))
    ahead, left = ((points - mean) @ frame).T
    first, last = left.min(), left.max()
    middle = (first + last) / 2
    near = np.argsort(np.abs(left - middle), kind="stable")[:3]
    across = (last - first + spacing_m) ** 2 / 12
    spread = frame @ np.diag([noise.sigma_m**2 + ahead[near].var(), across + noise.sigma_m**2]) @ frame.T
    return mean + frame @ np.array([ahead[near].mean(), middle]), spread


def _joined(beams: Beams, given: Sequence[Cluster], explain: _Explainer) -> list[Cluster]:
    """The clusters that explain the given ones best, found by joining the pair that gains most again and again."""
    clusters = list(given)
    points = {cluster: points_of(beams, cluster) for cluster in clusters}
    gains = np.full((len(clusters), len(clusters)), -np.inf)
    pairs: dict[tuple[Cluster, Cluster], _Pair] = {}
    totals = {cluster: one.total for cluster, one in zip(clusters, explain(clusters), strict=True)}
    left, changed = _MOST_PAIRS, list(range(len(clusters)))
    while True:
        near = _near(clusters, points, explain, changed)[:left] if left else []
        left -= len(near)
        new = _pairs(clusters, points, explain, near)
        for ((i, j), pair), joint in zip(new, explain((), [pair for _, pair in new]), strict=True):
            pairs[pair.first, pair.second] = pair
            totals[pair.both] = joint.total
            apart = totals[pair.first] + totals[pair.second]
            gains[i, j] = joint.total - apart - (_SURELY if pair.gap_m > _FAR_M else 0.0)
        first, second = np.unravel_index(int(np.argmax(gains)), gains.shape) if len(clusters) > 1 else (0, 0)
        if not gains.size or gains[first, second] <= 0:
            return clusters
        pair = pairs[clusters[first], clusters[second]]
        points[pair.both] = np.concatenate([points[pair.first], points[pair.second]])
        clusters[first] = pair.both
        del clusters[second]
        gains[first], gains[:, first] = -np.inf, -np.inf
        gains = np.delete(np.delete(gains, second, axis=0), second, axis=1)
        changed = [int(first)]


def _near(
    clusters: Sequence[Cluster], points: Mapping[Cluster, Array], explain: _Explainer, changed: Sequence[int]
) -> list[tuple[int, int]]:
    """The places of pairs with one of some clusters that could be near enough to be one object, nearest first."""
    if len(clusters) < 2:
        return []
    middles, radii = _circles(clusters, points)
    apart = np.hypot(*(middles[changed][:, None] - middles).T).T - np.add.outer(radii[changed], radii)
    rows, others = np.nonzero(apart <= explain.widest_m)
    places = np.asarray(changed)[rows]
    kept = places < others if len(changed) > 1 else places != others
    order = np.argsort(apart[rows, others][kept], kind="stable")
    ends = np.sort(np.stack([places[kept], others[kept]], axis=1), axis=1)[order]
    return [(i, j) for i, j in ends.tolist()]


def _circles(clusters: Sequence[Cluster], points: Mapping[Cluster, Array]) -> tuple[Array, Array]:
    """The middles (N, 2) of the hits of clusters, and how far (N,) they lie from these at most."""
    middles = np.array([points[cluster].mean(axis=0) for cluster in clusters])
    offsets = (points[cluster] - middle for cluster, middle in zip(clusters, middles, strict=True))
    return middles, np.array([float(np.hypot(*off.T).max()) for off in offsets])


def _pairs(
    clusters: Sequence[Cluster],
    points: Mapping[Cluster, Array],
    explain: _Explainer,
    near: Sequence[tuple[int, int]],
) -> list[tuple[tuple[int, int], _Pair]]:
    """Those of the places of near pairs that some shape can bridge, in the order of the clusters."""
    if not near:
        return []
    _, radii = _circles(clusters, points)
    found = []
    for i, j in sorted(near):
        first, second = clusters[i], clusters[j]
        gap = gap_m(points[first], points[second])
        widths = (2 * float(radii[i]), 2 * float(radii[j]))
        shapes = explain.bridging(gap, widths, _is_one_view(first, second))
        if shapes.any():
            both = tuple(sorted((*first, *second), key=lambda one: (one.sweep, one.first)))
            found.append(((i, j), _Pair(first, second, both, gap, shapes)))
    return found


def _ranked(names: Sequence[str], explained: _Explained, beams: Beams, cluster: Cluster, noise: Noise) -> Hypotheses:
    hits = hits_of(beams, cluster)
    point, spread = _surface(beams, hits, explained.spacing_m, noise)
    share = np.exp(explained.log_evidence - explained.log_evidence.max())
    share /= share.sum()
    possible = np.flatnonzero(np.isfinite(explained.log_evidence[:-1]))
    order = possible[np.argsort(-share[possible], kind="stable")]
    return Hypotheses(
        (*(names[i] for i in order), ""),
        np.append(share[order], share[-1]),
        np.vstack([explained.positions_xy[order], point]),
        np.concatenate([explained.covariances[order], spread[None]]),
        extent_m(beams.points_at(hits)),
    )
