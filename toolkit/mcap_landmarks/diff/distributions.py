"""How two drives' values of one field differ as a whole, where no value of one has its like in the other."""

from typing import NamedTuple

import numpy as np

from mcap_landmarks.diff.values import Array

LEAST = 0.05
"""A distance below this is none to speak of: less than one in twenty values lies elsewhere."""


class Spread(NamedTuple):
    """What can be said of N values: how many are finite, and their 5th, 50th and 95th percentile."""

    values: int
    p5: float
    median: float
    p95: float


def spread(values: Array) -> Spread | None:
    """The spread of values (N,); None where none is finite."""
    finite = values[np.isfinite(values)]
    return Spread(len(finite), *(float(value) for value in np.percentile(finite, [5, 50, 95]))) if len(finite) else None


def distance(one: Array, other: Array) -> float:
    """The Kolmogorov-Smirnov distance of finite values (N,) and (M,): the widest gap of their distribution functions.

    It is 0 for alike and 1 for values that do not overlap at all. There is no p-value: what a robot senses one moment
    after the other is far from independent, and thousands of messages would make any difference significant.
    """
    both = np.concatenate([one, other])
    shares = [np.searchsorted(np.sort(side), both, side="right") / len(side) for side in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def within(values: Array) -> float:
    """How far the first half of a drive's finite values (N,), in the order of time, is from the second."""
    half = len(values) // 2
    return distance(values[:half], values[half:]) if half else 0.0


def finite(values: Array) -> Array:
    """The values that are."""
    return values[np.isfinite(values)]
