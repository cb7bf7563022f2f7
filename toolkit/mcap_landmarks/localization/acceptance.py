"""When is a match no accident: class evidence, density of a map, and the expected number of accidental matches.

An a-contrario test (Desolneux, Moisan and Morel 2000): a match is accepted if matches as good are hardly to be expected
where it is wrong; that expectation is the number of false alarms. A place that the map does not know is taken to look
like the map: objects as frequent, as close together, and of the same classes. Against that stands what a pose in the
map predicts. The likelihood ratio of the two, summed over all poses, has expectation one where the place is unknown, so
its inverse bounds the expected number of accidents.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import gammaln

from mcap_landmarks.messages.hypotheses import Hypotheses

Array = NDArray[np.float64]

# Pairs within this factor of a distance count for the density there: a ring of two thirds of an octave.
_RATIO = 1.25
# Landmarks around which pairs are counted: counts of so many are known to 2 percent (their square root).
_CENTRES = 2000
# Distances in a factor of two at which the density is known: rings overlap, so that none is left out.
_PER_OCTAVE = 8
# Distances between which the density is known: from that of nearest neighbours (their 5 % quantile) to sixty times
# their median, farther than objects of one bundle are apart; at least three octaves.
_LOW_QUANTILE, _WIDE, _WIDE_AT_LEAST = 0.05, 60, 8


@dataclass(frozen=True, slots=True, eq=False)
class ClassEvidence:
    """Which classes there are to expect. frequency (C,) of `names` at an unknown place; the rest is classes not mapped.

    `misread` is the probability that an object's classes say nothing about what it is.
    """

    names: tuple[str, ...]
    frequency: Array
    misread: float

    @classmethod
    def of(cls, names: tuple[str, ...], class_of: NDArray[np.int64], misread: float) -> "ClassEvidence":
        """Frequencies after Good and Turing (Good 1953): classes that the map has once say that there are more."""
        counts = np.bincount(class_of, minlength=len(names))
        unseen = (counts == 1).sum() / (len(class_of) + 1)
        return cls(names, (1 - unseen) * counts / len(class_of), misread)

    def probabilities(self, hypotheses: Sequence[Hypotheses]) -> Array:
        """Likelihoods (N, C) of what was seen of N objects, were they of each class, up to a factor per object."""
        number = {name: i for i, name in enumerate(self.names)}
        seen = np.zeros((len(hypotheses), len(self.names)))
        for row, options in enumerate(hypotheses):
            for name, score in options:
                if name in number:
                    seen[row, number[name]] += max(score, 0.0)
            total = sum(max(score, 0.0) for _, score in options)
            if total > 0:
                seen[row] /= total
        return (1 - self.misread) * seen + self.misread / len(self.names)

    def log_ratios(self, probabilities: Array) -> Array:
        """Logarithms (N, C) of how much likelier each class makes what was seen than an unknown place does."""
        unseen = 1 - self.frequency.sum()
        anywhere = probabilities @ self.frequency + unseen * self.misread / len(self.names)
        ratios: Array = np.log(probabilities / anywhere[:, None])
        return ratios


@dataclass(frozen=True, slots=True, eq=False)
class PairDensity:
    """Landmarks per square metre at each distance from a landmark, as logarithms (R,) over log_distance (R,)."""

    log_distance: Array
    log_density: Array

    @classmethod
    def of(cls, places: cKDTree, positions: Array) -> "PairDensity":
        """Density around landmarks, each distance averaged over a ring; one pair more than was counted."""
        centres = positions[:: max(len(positions) // _CENTRES, 1)]
        nearest = np.asarray(places.query(centres, k=[2])[0])[:, 0]
        low = max(float(np.quantile(nearest, _LOW_QUANTILE)), 1e-6)
        high = max(float(np.median(nearest)) * _WIDE, _WIDE_AT_LEAST * low)
        steps = int(np.ceil(np.log2(high / low) * _PER_OCTAVE))
        distance = low * 2 ** (np.arange(steps + 1) / _PER_OCTAVE)
        radii = np.concatenate([distance / _RATIO, distance * _RATIO])
        order = np.argsort(radii, kind="stable")
        counts = np.empty(len(radii))
        counts[order] = cKDTree(centres).count_neighbors(places, radii[order])
        inner, outer = np.split(counts, 2)
        area = np.pi * distance**2 * (_RATIO**2 - _RATIO**-2)
        return cls(np.log(distance), np.log((outer - inner + 1) / (len(centres) * area)))

    def chain(self, points: Array) -> Array:
        """Logarithm (B, K) of the density expected at each of K points (B, K, 2) by those before it.

        The order is the one in which the nearest comes next. The first, of which nothing is expected, gets the lowest
        of the others.
        """
        count, k = points.shape[:2]
        apart = np.linalg.norm(points[:, :, None] - points[:, None], axis=-1)
        density = self.at(apart)
        rows = np.arange(count)
        out = np.full((count, k), np.inf)
        nearest, expected = apart[:, 0].copy(), density[:, 0].copy()
        nearest[:, 0] = np.inf
        for _ in range(k - 1):
            following = nearest.argmin(axis=1)
            out[rows, following] = expected[rows, following]
            nearest = np.minimum(nearest, apart[rows, following])
            nearest[np.isfinite(out)] = np.inf
            nearest[:, 0] = np.inf
            expected = np.maximum(expected, density[rows, following])
        out[:, 0] = out.min(axis=1) if k > 1 else self.log_density[-1]
        return out

    def at(self, distance_m: Array) -> Array:
        """Logarithm (...) of the density at distances (...) from a landmark."""
        density: Array = np.interp(np.log(np.maximum(distance_m, 1e-12)), self.log_distance, self.log_density)
        return density


def log_tail(chi2: Array, dof: NDArray[np.int64]) -> Array:
    """Logarithm of the volume in which an accident fits as well as this, over that under a Gaussian's peak.

    That is of a ball in `dof` dimensions with squared radius `chi2`. A fit better than chi-square's mean counts as the
    mean: luck must not speak for a match.
    """
    half_dof = np.maximum(dof, 1) / 2
    half_chi2 = np.maximum(chi2 / 2, half_dof)
    volume: Array = half_dof * np.log(half_chi2) - gammaln(half_dof + 1)
    return volume
