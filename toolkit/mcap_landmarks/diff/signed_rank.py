"""The signed-rank test of paired differences (Wilcoxon 1945), its interval, and the equivalence test made of two."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from mcap_landmarks.diff.values import Array


class Shift(NamedTuple):
    """Where paired differences lie: the Hodges-Lehmann estimate, its interval, and the p-value of "they lie at 0".

    low and high are -inf and inf where there are too few pairs for the confidence that was asked for.
    """

    estimate: float
    low: float
    high: float
    p_change: float


def shift(differences: Array, confidence: float) -> Shift:
    """The shift of N >= 1 paired differences (N,), with an interval of a confidence between 0 and 1.

    The null distribution is exact, so it knows how little few pairs can show, and asks for symmetry alone, which
    differences have whose sides could be swapped: neither normal errors nor equal noise in all pairs. Zeros and ties
    make it conservative. Nothing is drawn at random. Lehmann 2006, Nonparametrics, sections 3.2 and 4.4.
    """
    averages, tail = _walsh_averages(differences), _tail(len(differences))
    outside = int(np.sum(tail <= (1 - confidence) / 2))
    low, high = (averages[outside - 1], averages[-outside]) if outside else (-math.inf, math.inf)
    more = max(int(np.sum(averages > 0)), int(np.sum(averages < 0)))
    return Shift(float(np.median(averages)), float(low), float(high), min(1.0, 2 * float(tail[more])))


def p_apart(differences: Array, margin: float) -> float:
    """The p-value of "paired differences (N,) lie `margin` or more from 0"; where it is small they are equivalent.

    Two one-sided tests (Schuirmann 1987) by signed ranks.
    """
    averages, tail = _walsh_averages(differences), _tail(len(differences))
    return max(float(tail[int(np.sum(averages > -margin))]), float(tail[int(np.sum(averages < margin))]))


def least_pairs(level: float) -> int:
    """How many pairs it takes at least until the test can reject at a one-sided level."""
    return math.ceil(-math.log2(level))


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values of several tests such that the chance of any false alarm stays below the level (Holm 1979)."""
    adjusted, worst = [0.0] * len(p_values), 0.0
    for place, row in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        worst = max(worst, min(1.0, (len(p_values) - place) * p_values[row]))
        adjusted[row] = worst
    return adjusted


def _walsh_averages(differences: Array) -> Array:
    """The averages (N (N + 1) / 2,) of every two differences and of each with itself, sorted."""
    mine, theirs = np.triu_indices(len(differences))
    return np.sort((differences[mine] + differences[theirs]) / 2)


@cache
def _tail(count: int) -> Array:
    """P(W >= k) for k from 0 to N (N + 1) / 2: W is how many averages of N differences about 0 are above 0."""
    chances = np.ones(1)
    for rank in range(1, count + 1):
        chances = (np.append(chances, np.zeros(rank)) + np.append(np.zeros(rank), chances)) / 2
    return np.minimum(np.cumsum(chances[::-1])[::-1], 1.0)
