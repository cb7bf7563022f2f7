"""The signed-rank test agrees with SciPy's, and knows how little few pairs can show."""

import math

import numpy as np
import pytest
from mcap_landmarks.diff.signed_rank import holm, least_pairs, p_apart, shift
from scipy.stats import wilcoxon


@pytest.mark.parametrize("count", [5, 6, 11, 20])
def test_p_values_are_those_of_scipy(count: int) -> None:
    differences = np.random.default_rng(count).normal(0.4, 1, count)
    found = shift(differences, 0.95)
    assert found.p_change == pytest.approx(wilcoxon(differences, method="exact").pvalue, rel=1e-9)
    sides = (
        wilcoxon(differences + 0.9, alternative="greater", method="exact").pvalue,
        wilcoxon(differences - 0.9, alternative="less", method="exact").pvalue,
    )
    assert p_apart(differences, 0.9) == pytest.approx(max(sides), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_has_zero_where_the_test_does_not_reject(seed: int) -> None:
    differences = np.random.default_rng(seed).normal(0.6, 1, 12)
    found = shift(differences, 0.95)
    assert (found.low <= 0 <= found.high) == (found.p_change > 0.05)
    assert found.low < found.estimate < found.high


def test_few_pairs_bound_nothing() -> None:
    assert shift(np.full(5, 0.3), 0.95)[1:3] == (-math.inf, math.inf)
    assert shift(np.full(6, 0.3), 0.95) == (0.3, 0.3, 0.3, 2 / 2**6)
    assert (least_pairs(0.025), least_pairs(0.05)) == (6, 5)


def test_zeros_and_ties_never_help_a_change() -> None:
    assert shift(np.zeros(20), 0.95).p_change == 1
    assert p_apart(np.zeros(20), 0.01) == pytest.approx(2**-20)
    assert shift(np.array([0.0] * 10 + [1.0] * 4), 0.95).p_change > 0.05


def test_holm() -> None:
    assert holm([0.01, 0.04, 0.03, 0.9]) == pytest.approx([0.04, 0.09, 0.09, 0.9])
    assert holm([]) == []
