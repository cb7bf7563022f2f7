"""What many pairs of logs say of each figure: same, better, worse, or that they are too few to tell."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mcap_landmarks.diff.criteria import METRICS, Criteria, Criterion, Metric
from mcap_landmarks.diff.log_figures import Values
from mcap_landmarks.diff.set_document import FigureEntry, Verdict, VerdictEntry
from mcap_landmarks.diff.signed_rank import holm, least_pairs, p_apart, shift
from mcap_landmarks.diff.values import Array
from mcap_landmarks.wording import counted

Sides = tuple[Values, Values]
"""The figures of one log in the baseline and in the candidate."""


def verdicts(pairs: Sequence[Sides], criteria: Criteria) -> dict[str, VerdictEntry]:
    """A verdict for each figure that any pair has on both sides.

    `same` is shown, not assumed: the change lies within the margin, by two one-sided tests. Figures that gate are one
    family of tests, the others a second one: in each the chance of any false `better`, `worse` or `changed` stays
    below 1 - confidence (Holm). What is the same in every log cannot be a false alarm, and is in neither.
    """
    found = {name: _entry(name, pairs, criteria) for name in METRICS}
    known = {name: entry for name, entry in found.items() if entry is not None}
    for gates in (True, False):
        _judge_together({name: entry for name, entry in known.items() if entry["gates"] == gates}, pairs, criteria)
    equal = all(mine == theirs for mine, theirs in pairs)
    for entry in known.values():
        if equal:
            entry["verdict"], entry["confidence"], entry["note"] = "same", None, "every figure of every log is equal"
        failing = {"worse", "changed", *(["inconclusive"] if criteria.inconclusive == "fail" else [])}
        entry["fails"] = entry["gates"] and entry["verdict"] in failing
    return known


def overall(entries: Mapping[str, VerdictEntry]) -> Verdict:
    """The verdict over all figures that gate: as bad as the worst of them; inconclusive where there are none."""
    given = {entry["verdict"] for entry in entries.values() if entry["gates"]}
    ranks: tuple[Verdict, ...] = ("worse", "changed", "inconclusive", "better", "same")
    return next((verdict for verdict in ranks if verdict in given), "inconclusive")


def figure(name: str, pair: Sides) -> FigureEntry:
    """A figure of one log in both runs."""
    mine, theirs = (side.get(name) for side in pair)
    if mine is None or theirs is None:
        return {"baseline": mine, "candidate": theirs, "delta": None, "change": None}
    metric = METRICS[name]
    change = theirs - mine
    if metric.relative:
        change = max(theirs, metric.least) / max(mine, metric.least) - 1
    return {"baseline": mine, "candidate": theirs, "delta": theirs - mine, "change": change}


def worsening(name: str, pair: Sides, criterion: Criterion) -> float | None:
    """By how many margins a figure of one log got worse: below zero better, infinite where only the baseline has it.

    Of a figure that is neither, a change either way is worse. None where the baseline lacks it.
    """
    mine, theirs = (side.get(name) for side in pair)
    if mine is None:
        return None
    if theirs is None:
        return math.inf
    metric = METRICS[name]
    change = float(_scaled(np.array([theirs]), metric, criterion)[0] - _scaled(np.array([mine]), metric, criterion)[0])
    signed = {"higher": -change, "none": abs(change)}.get(criterion.direction, change)
    return signed / _scaled_margin(metric, criterion.margin)


def _entry(name: str, pairs: Sequence[Sides], criteria: Criteria) -> VerdictEntry | None:
    both = _both(name, pairs)
    if not len(both):
        return None
    metric, criterion = METRICS[name], criteria.metrics[name]
    baseline, candidate = both.T
    differences = _scaled(candidate, metric, criterion) - _scaled(baseline, metric, criterion)
    found = shift(differences, criteria.confidence)
    low, high = (_shown(value, metric) if math.isfinite(value) else None for value in (found.low, found.high))
    return {
        "verdict": "inconclusive",
        "fails": False,
        "gates": criterion.gates,
        "direction": criterion.direction,
        "relative": metric.relative,
        "margin": criterion.margin,
        "logs": len(both),
        "lost": sum(mine.get(name) is not None and theirs.get(name) is None for mine, theirs in pairs),
        "baseline": float(np.median(baseline)),
        "candidate": float(np.median(candidate)),
        "change": _shown(found.estimate, metric),
        "low": low,
        "high": high,
        "p_change": found.p_change,
        "p_same": p_apart(differences, _scaled_margin(metric, criterion.margin)),
        "confidence": None,
        "note": None,
    }


def _judge_together(family: Mapping[str, VerdictEntry], pairs: Sequence[Sides], criteria: Criteria) -> None:
    """Give verdicts to metrics that are tested together."""
    tested = [name for name in family if any(_changes(name, pairs))]
    for name, p_value in zip(tested, holm([family[name]["p_change"] for name in tested]), strict=True):
        family[name]["p_change"] = p_value
    for entry in family.values():
        _judge(entry, criteria, max(len(tested), 1))


def _judge(entry: VerdictEntry, criteria: Criteria, together: int) -> None:
    """Give a verdict; `together` is how many figures are tested with this one."""
    level = 1 - criteria.confidence
    if entry["p_same"] <= level:
        entry["verdict"], entry["confidence"] = "same", 1 - entry["p_same"]
    elif entry["p_change"] <= level:
        ways: dict[str, tuple[Verdict, Verdict]] = {"higher": ("better", "worse"), "none": ("changed", "changed")}
        more, less = ways.get(entry["direction"], ("worse", "better"))
        entry["verdict"], entry["confidence"] = (more if entry["change"] > 0 else less), 1 - entry["p_change"]
    else:
        entry["note"] = _why_not(entry, level, together)


def _why_not(entry: VerdictEntry, level: float, together: int) -> str | None:
    """Why there is no verdict, where it takes more logs for any."""
    tell = "tells" if entry["logs"] == 1 else "tell"
    logs, change, same = counted(entry["logs"], "log"), least_pairs(level / 2 / together), least_pairs(level)
    if entry["logs"] < same:
        return f"{logs} {tell} too little: sameness can be shown with {same} or more, a change with {change}"
    return f"{logs} {tell} too little: a change can be shown with {change} or more" if entry["logs"] < change else None


def _changes(name: str, pairs: Sequence[Sides]) -> list[bool]:
    return [bool(mine != theirs) for mine, theirs in _both(name, pairs)]


def _both(name: str, pairs: Sequence[Sides]) -> Array:
    """The values (K, 2) of the pairs that have a figure on both sides."""
    values = [(mine.get(name), theirs.get(name)) for mine, theirs in pairs]
    return np.array([both for both in values if None not in both], dtype=np.float64).reshape(-1, 2)


def _scaled(values: Array, metric: Metric, criterion: Criterion) -> Array:
    """Values such that their differences are what is compared: logarithms, or the values themselves."""
    if not metric.relative:
        return values
    logs: Array = np.log(np.maximum(values, metric.least))
    return np.abs(logs) if criterion.direction == "one" else logs


def _scaled_margin(metric: Metric, margin: float) -> float:
    return math.log1p(margin) if metric.relative else margin


def _shown(difference: float, metric: Metric) -> float:
    return math.expm1(difference) if metric.relative else difference
