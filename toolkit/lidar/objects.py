"""Segments to objects: which of them belong together, what each could be, and where its centre is then."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from toolkit.geometry.se2 import Array, rotation
from toolkit.lidar.beams import Beams
from toolkit.lidar.cells import Noise
from toolkit.lidar.centres import centres
from toolkit.lidar.segments import Segment, extent_m
from toolkit.lidar.shapes import Shape
from toolkit.lidar.windows import Cluster, windows

_NONE = 0.1
"""How likely something is of no known shape, before anyone looks."""
_PER_M2 = 0.05
"""Objects per square metre where there are any: two side by side are less likely than one of two parts."""
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
    """A cluster under H hypotheses, the last one the bare surface: log_evidence (H,), positions (H, 2), (H, 2, 2)."""

    log_evidence: Array
    positions_xy: Array
    covariances: Array

    @property
    def total(self) -> float:
        """The logarithm of the evidence for an object of whatever kind here."""
        top = float(self.log_evidence.max())
        return top + float(np.log(np.exp(self.log_evidence - top).sum())) + float(np.log(_PER_M2))


def objects(
    beams: Beams, segments: Sequence[Segment], shapes: Mapping[str, Sequence[Shape]], noise: Noise
) -> list[Hypotheses]:
    """The objects of a scan, each with every class of `shapes` that it could be, by name with the shapes of a class.

    Neighbouring segments make one object where that explains them better than an object each: the legs of a person, a
    box and its far corner, or what two LiDARs see of one thing.
    """
    kinds = [(name, shape) for name, options in shapes.items() for shape in options]
    explain = _Explainer(beams, kinds, _priors(shapes), noise)
    clusters = _joined(beams, segments, explain, max((_bridge_m(shape) for _, shape in kinds), default=0.0))
    return [
        _ranked([name for name, _ in kinds], explained, beams, cluster)
        for cluster, explained in zip(clusters, explain(clusters), strict=True)
    ]


def _priors(shapes: Mapping[str, Sequence[Shape]]) -> Array:
    classes = [options for options in shapes.values() if options]
    share = [(1 - _NONE) / len(classes) / len(options) for options in classes for _ in options]
    return np.array([*share, _NONE if classes else 1.0])


def _bridge_m(shape: Shape) -> float:
    """The widest gap that the shape's parts leave between them, 0 for a single part."""
    if shape.apart_m is not None:
        return shape.apart_m[1] - 2 * shape.discs[0][2]
    parts = [(x, y, radius) for x, y, radius in shape.discs]
    parts += [(x, y, min(length, width) / 2) for x, y, length, width in shape.boxes]
    gaps = np.array([[np.hypot(a[0] - b[0], a[1] - b[1]) - a[2] - b[2] for b in parts] for a in parts])
    np.fill_diagonal(gaps, np.inf)
    return float(gaps.min(axis=1).max()) if len(parts) > 1 else 0.0


class _Explainer:
    """Explains clusters, each but once."""

    def __init__(self, beams: Beams, kinds: Sequence[tuple[str, Shape]], priors: Array, noise: Noise) -> None:
        self._beams, self._noise = beams, noise
        self._shapes = list(dict.fromkeys(shape for _, shape in kinds))
        self._row = [self._shapes.index(shape) for _, shape in kinds]
        self._log_priors = np.log(priors)
        self._known: dict[Cluster, _Explained] = {}

    def __call__(self, clusters: Sequence[Cluster]) -> list[_Explained]:
        new = [cluster for cluster in dict.fromkeys(clusters) if cluster not in self._known]
        if new:
            self._explain(new)
        return [self._known[cluster] for cluster in clusters]

    def _explain(self, clusters: Sequence[Cluster]) -> None:
        window = windows(self._beams, clusters)
        found = centres(window, self._shapes, self._noise)
        for i, cluster in enumerate(clusters):
            point, spread = _surface(self._beams, cluster, float(window.spacing_m[i]), self._noise)
            hits = int(window.is_hit[i].sum())
            nothing = np.log(window.spacing_m[i]) - (hits - 1) * np.log(_UNKNOWN_M)
            self._known[cluster] = _Explained(
                np.append(found.log_evidence[i, self._row], nothing) + self._log_priors,
                np.vstack([found.positions_xy[i, self._row], point]),
                np.concatenate([found.covariances[i, self._row], spread[None]]),
            )


def _surface(beams: Beams, cluster: Cluster, spacing_m: float, noise: Noise) -> tuple[Array, Array]:
    """The point in the middle of what a scan sees of a cluster, and its covariance."""
    hits = np.concatenate([segment.hits(beams) for segment in cluster])
    points = beams.points_xy[hits]
    away = points.mean(axis=0) - beams.origins_xy[hits].mean(axis=0)
    frame = rotation(np.arctan2(away[1], away[0]))
    local = (points - points.mean(axis=0)) @ frame
    middle = (local[:, 1].min() + local[:, 1].max()) / 2
    near = np.argsort(np.abs(local[:, 1] - middle), kind="stable")[:3]
    depth = local[near, 0]
    across = (np.ptp(local[:, 1]) + spacing_m) ** 2 / 12
    spread = frame @ np.diag([noise.sigma_m**2 + depth.var(), across + noise.sigma_m**2]) @ frame.T
    return points.mean(axis=0) + frame @ np.array([depth.mean(), middle]), spread


def _joined(
    beams: Beams, segments: Sequence[Segment], explain: Callable[[Sequence[Cluster]], list[_Explained]], bridge_m: float
) -> list[Cluster]:
    """The clusters that explain the segments best, found by joining the pair that gains most again and again."""
    clusters: list[Cluster] = [(segment,) for segment in segments]
    points = {cluster: beams.points_xy[cluster[0].hits(beams)] for cluster in clusters}
    while True:
        pairs = [pair for pair in combinations(clusters, 2) if _gap_m(points[pair[0]], points[pair[1]]) <= bridge_m]
        both = [tuple(sorted((*a, *b), key=lambda one: (one.sweep, one.first))) for a, b in pairs]
        alone = {cluster: explained.total for cluster, explained in zip(clusters, explain(clusters), strict=True)}
        gains = [joint.total - alone[a] - alone[b] for joint, (a, b) in zip(explain(both), pairs, strict=True)]
        best = int(np.argmax(gains)) if gains else -1
        if best < 0 or gains[best] <= 0:
            return clusters
        a, b = pairs[best]
        points[both[best]] = np.concatenate([points[a], points[b]])
        clusters = [both[best] if cluster == a else cluster for cluster in clusters if cluster != b]


def _gap_m(first: Array, second: Array) -> float:
    """The distance between the nearest points (N, 2) and (M, 2)."""
    offsets = first[:, None] - second
    return float(np.sqrt((offsets**2).sum(axis=-1).min()))


def _ranked(names: Sequence[str], explained: _Explained, beams: Beams, cluster: Cluster) -> Hypotheses:
    share = np.exp(explained.log_evidence - explained.log_evidence.max())
    share /= share.sum()
    possible = np.flatnonzero(np.isfinite(explained.log_evidence[:-1]))
    order = [*possible[np.argsort(-share[possible], kind="stable")].tolist(), len(names)]
    hits = np.concatenate([segment.hits(beams) for segment in cluster])
    return Hypotheses(
        tuple([*names, ""][i] for i in order),
        share[order],
        explained.positions_xy[order],
        explained.covariances[order],
        extent_m(beams.points_xy[hits]),
    )
