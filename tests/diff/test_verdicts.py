"""What pairs of logs say: sameness is shown, changes are not called by chance, and few logs say little."""

from collections.abc import Sequence

import numpy as np
import pytest
from mcap_landmarks.diff.criteria import METRICS, Criteria, Criterion
from mcap_landmarks.diff.verdicts import Sides, figure, overall, verdicts, worsening

RMSE = "position.rmse_m"


def pairs(ratios: Sequence[float], name: str = RMSE) -> list[Sides]:
    """Pairs whose candidates have so many times the baseline's value."""
    return [({name: 0.03 + 0.01 * i}, {name: (0.03 + 0.01 * i) * ratio}) for i, ratio in enumerate(ratios)]


def around(ratio: float, count: int = 12, noise: float = 0.005) -> list[float]:
    return [ratio * (1 + noise * ((i % 5) - 2) / 2) for i in range(count)]


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        (around(1.0), "same"),
        (around(1.005), "same"),  # a change, but none that matters
        (around(1.1), "worse"),
        (around(0.9), "better"),
        (around(1.0, noise=0.3), "inconclusive"),
        (around(1.02, noise=0.02), "worse"),
        (around(3.0, count=3), "inconclusive"),
        (around(1.0, count=2), "inconclusive"),
    ],
)
def test_verdicts(ratios: list[float], expected: str) -> None:
    entry = verdicts(pairs(ratios), Criteria())[RMSE]
    assert entry["verdict"] == expected
    assert (entry["confidence"] is None) == (expected == "inconclusive")
    assert entry["fails"] == (expected == "worse")


def test_few_logs_say_how_many_it_takes() -> None:
    note = verdicts(pairs(around(2.0, count=3)), Criteria())[RMSE]["note"]
    assert note == "3 logs tell too little: sameness can be shown with 5 or more, a change with 6"
    note = verdicts(pairs(around(2.0, count=5)), Criteria())[RMSE]["note"]
    assert note == "5 logs tell too little: a change can be shown with 6 or more"
    assert verdicts(pairs(around(1.0, noise=0.3)), Criteria())[RMSE]["note"] is None


def test_what_is_equal_in_every_figure_needs_no_test() -> None:
    entry = verdicts(pairs([1.0]), Criteria())[RMSE]
    assert (entry["verdict"], entry["confidence"]) == ("same", None)
    assert entry["note"] == "every figure of every log is equal"


def test_several_metrics_are_tested_together() -> None:
    """Six logs of two metrics: alone each would be called worse, together neither is."""
    one, two = pairs(around(1.1, count=6)), pairs(around(1.1, count=6), "heading.rmse_deg")
    both: list[Sides] = [({**a, **c}, {**b, **d}) for (a, b), (c, d) in zip(one, two, strict=True)]
    assert verdicts(one, Criteria())[RMSE]["verdict"] == "worse"
    assert {entry["verdict"] for entry in verdicts(both, Criteria()).values()} == {"inconclusive"}
    unchanged: list[Sides] = [({**a, "false.share": 0.0}, {**b, "false.share": 0.0}) for a, b in one]
    assert verdicts(unchanged, Criteria())[RMSE]["verdict"] == "worse"  # what is equal everywhere takes nothing away


def test_directions() -> None:
    higher = [({"localized_share": 0.9}, {"localized_share": 0.8 + 0.001 * i}) for i in range(8)]
    assert verdicts(higher, Criteria())["localized_share"]["verdict"] == "worse"
    honest = [({"nees": 3.0}, {"nees": 0.9 + 0.01 * i}) for i in range(12)]
    assert verdicts(honest, Criteria())["nees"]["verdict"] == "better"
    neither = [({"sigma_m": 0.1}, {"sigma_m": 0.2 + 0.01 * i}) for i in range(12)]
    entry = verdicts(neither, Criteria())["sigma_m"]
    assert (entry["verdict"], entry["fails"]) == ("changed", False)


def test_a_figure_that_vanished_is_told_and_is_the_worst() -> None:
    found = [*pairs(around(1.0, count=7)), ({RMSE: 0.02}, {RMSE: None})]
    entry = verdicts(found, Criteria())[RMSE]
    assert (entry["logs"], entry["lost"]) == (7, 1)
    criterion = METRICS[RMSE].criterion
    assert worsening(RMSE, found[-1], criterion) == np.inf
    assert worsening(RMSE, ({RMSE: None}, {RMSE: 1.0}), criterion) is None
    assert worsening(RMSE, ({RMSE: 1.0}, {RMSE: 1.02}), criterion) == pytest.approx(1)
    assert figure(RMSE, found[-1]) == {"baseline": 0.02, "candidate": None, "delta": None, "change": None}
    assert figure(RMSE, ({RMSE: 0.0}, {RMSE: 2e-5}))["change"] == 0  # below what anybody needs


def test_the_verdict_over_all_is_that_of_the_worst_that_gates() -> None:
    found = verdicts(pairs(around(1.1)), Criteria())
    assert overall(found) == "worse"
    metrics = {**Criteria().metrics, RMSE: Criterion(0.02, "lower", gates=False)}
    assert overall(verdicts(pairs(around(1.1)), Criteria(metrics=metrics))) == "inconclusive"
    strict = verdicts(pairs(around(1.0, noise=0.3)), Criteria(inconclusive="fail"))
    assert strict[RMSE]["fails"]


@pytest.mark.slow
def test_false_alarms_stay_below_the_level() -> None:
    """Of 400 pairs of sets that differ by noise alone; each set has two metrics that go their own ways."""
    rng, alarms = np.random.default_rng(4), 0
    for _ in range(400):
        ratios = np.exp(rng.normal(0, 0.2, (10, 2)))
        sides: list[Sides] = [
            ({RMSE: 1.0, "heading.rmse_deg": 1.0}, {RMSE: a, "heading.rmse_deg": b}) for a, b in ratios
        ]
        alarms += any(entry["verdict"] in {"worse", "better"} for entry in verdicts(sides, Criteria()).values())
    assert alarms <= 0.05 * 400
