"""Distances between distributions, and what a drive differs by within itself."""

import numpy as np
import pytest
from mcap_landmarks.diff.distributions import distance, spread, within
from scipy.stats import ks_2samp


def test_the_distance_is_that_of_kolmogorov_and_smirnov() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(0, 1, 300), rng.normal(0.4, 2, 170).round(1)
    assert distance(one, other) == pytest.approx(ks_2samp(one, other).statistic)
    assert distance(one, one) == 0
    assert distance(one, one + 100) == 1


def test_within_a_drive() -> None:
    assert within(np.r_[np.zeros(50), np.ones(50)]) == 1
    assert within(np.tile([0.0, 1.0], 50)) == 0
    assert within(np.ones(1)) == 0


def test_spread_leaves_out_what_is_not_finite() -> None:
    assert spread(np.array([1.0, np.nan, 3.0, np.inf, 2.0])) == (3, 1.1, 2.0, pytest.approx(2.9))
    assert spread(np.array([np.nan])) is None
