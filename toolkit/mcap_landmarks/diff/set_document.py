"""The document of `diff --json` of two sets of runs, as schemas/json/diff_sets.schema.json describes it."""

from typing import Literal, TypedDict

from mcap_landmarks.diff.document import ConditionEntry, ManifestRow, MetricEntry

Verdict = Literal["same", "better", "worse", "changed", "inconclusive"]


class VerdictEntry(TypedDict):
    """What was found of one figure over all pairs of logs that have it.

    baseline and candidate are medians over the logs. change, low and high tell how much the candidate differs in a
    log, with an interval of the confidence asked for: relative (0.05 is 5 % more), or the difference of shares and
    counts; low and high are None where there are too few logs. p_change is adjusted for all figures that are tested
    together. confidence is that of the verdict, None where there is no verdict or no test was needed.
    """

    verdict: Verdict
    fails: bool
    gates: bool
    direction: str
    relative: bool
    margin: float
    logs: int
    lost: int
    baseline: float
    candidate: float
    change: float
    low: float | None
    high: float | None
    p_change: float
    p_same: float
    confidence: float | None
    note: str | None


class FigureEntry(MetricEntry):
    """A figure of one log in both runs; change as in `VerdictEntry`, None where a side lacks it."""

    change: float | None


class LogEntry(TypedDict):
    """A log of both runs: what it was paired by, its worst figure that gates, and what of it fails, in words."""

    log: str
    candidate: str
    paired_by: Literal["fingerprint", "name"]
    worst: str | None
    figures: dict[str, FigureEntry]
    fails: list[str]


class BrokenEntry(TypedDict):
    """A log that could not be compared, and why."""

    log: str
    side: Literal["baseline", "candidate"]
    error: str


class SharedRow(ManifestRow):
    """What was meant to differ, and in how many of the pairs."""

    logs: int


class UnpairedLogs(TypedDict):
    """The logs that only one side has, by name."""

    baseline: list[str]
    candidate: list[str]


class SetDocument(TypedDict):
    """Everything that a comparison of two sets found; `partial` where a log could not be compared.

    `repeated` are the logs of a recording that another log is of: for verdicts they count as one, with their means.
    """

    verdict: Verdict
    fails: bool
    partial: bool
    confidence: float
    pairs: int
    repeated: list[str]
    unpaired: UnpairedLogs
    missing_fails: bool
    broken: list[BrokenEntry]
    manifest: list[SharedRow]
    metrics: dict[str, VerdictEntry]
    logs: list[LogEntry]
    conditions: list[ConditionEntry]
