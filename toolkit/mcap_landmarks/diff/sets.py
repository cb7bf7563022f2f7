"""The diff of two sets of runs: two folders of logs with results, or one and what was blessed before."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, SupportsFloat

import numpy as np

from mcap_landmarks.diff.blessed import BlessedLog
from mcap_landmarks.diff.conditions import FailCondition
from mcap_landmarks.diff.criteria import METRICS, Criteria, Criterion
from mcap_landmarks.diff.declared import manifest_rows
from mcap_landmarks.diff.document import ManifestRow
from mcap_landmarks.diff.log_figures import ReadLog
from mcap_landmarks.diff.paired_logs import LogPair, pair_logs
from mcap_landmarks.diff.set_document import BrokenEntry, LogEntry, SetDocument, SharedRow, UnpairedLogs
from mcap_landmarks.diff.set_logs import SetLog, Truths, figures_of, logs_in, read_whole
from mcap_landmarks.diff.verdicts import Sides, figure, overall, verdicts, worsening
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress

_Side = Literal["baseline", "candidate"]
_SIDES: tuple[_Side, _Side] = ("baseline", "candidate")


def diff_sets(
    baseline: Location,
    candidate: Location,
    criteria: Criteria | None = None,
    conditions: Sequence[FailCondition] = (),
    *,
    reference: Location | None = None,
    progress: Progress | None = None,
) -> SetDocument:
    """What changed from the logs of a baseline to those of a candidate, with a verdict for each figure over all logs.

    Either may be blessed results. `reference` has the truth that logs lack: a file for all, or a folder of logs. A log
    that cannot be read whole is told in `broken`, and the others are compared.

    Raises:
        ToolkitError: a set is empty, no log is in both, or a condition is wrong.
    """
    rules, truths = criteria or Criteria(), Truths(reference)
    sets = logs_in(baseline), logs_in(candidate)
    pairs = pair_logs(*sets)
    if not pairs:
        raise UsageError(f"{baseline} and {candidate}: no log is in both, by its recording or its name")
    compared: list[tuple[float, LogEntry, Sides]] = []
    broken, rows = list[BrokenEntry](), list[ManifestRow]()
    for pair in pairs:
        logs = sets[0][pair.baseline], sets[1][pair.candidate]
        read = _read(logs, broken, progress)
        if len(read) < 2:
            continue
        sides = _figures(logs, read, truths, broken)
        if sides is not None:
            compared.append((*_log_entry(logs, pair, sides, rules), sides))
            rows += manifest_rows(read[0].manifest, read[1].manifest)
    unpaired: UnpairedLogs = {
        "baseline": _others("baseline", sets[0], [pair.baseline for pair in pairs], broken),
        "candidate": _others("candidate", sets[1], [pair.candidate for pair in pairs], broken),
    }
    marks = {log.name: log.fingerprint for log in sets[0]}
    compared.sort(key=lambda one: (-one[0], one[1]["log"]))
    document = _document(rules, [(entry, sides) for _, entry, sides in compared], unpaired, broken, marks)
    document["manifest"] = _shared(rows)
    return _judged(document, conditions, alone=criteria is None)


def _others(side: _Side, logs: Sequence[SetLog], taken: Sequence[int], broken: list[BrokenEntry]) -> list[str]:
    """The logs of a side without a partner; those that cannot be read are told in `broken`."""
    rest = [log for row, log in enumerate(logs) if row not in taken]
    broken += [{"log": log.name, "side": side, "error": log.error} for log in rest if log.error is not None]
    return [log.name for log in rest if log.error is None]


def _read(
    logs: tuple[SetLog, SetLog], broken: list[BrokenEntry], progress: Progress | None
) -> list[ReadLog | BlessedLog]:
    """Both sides of a pair; those that cannot be read are told in `broken` instead."""
    found = []
    for side, log in zip(_SIDES, logs, strict=True):
        try:
            found.append(read_whole(log, progress))
        except ToolkitError as error:
            broken.append({"log": log.name, "side": side, "error": str(error)})
    return found


def _figures(
    logs: tuple[SetLog, SetLog], read: Sequence[ReadLog | BlessedLog], truths: Truths, broken: list[BrokenEntry]
) -> Sides | None:
    try:
        mine, theirs = figures_of(logs, read, truths)
    except ToolkitError as error:
        broken.append({"log": logs[0].name, "side": "baseline", "error": str(error)})
        return None
    return mine, theirs


def _log_entry(logs: tuple[SetLog, SetLog], pair: LogPair, sides: Sides, rules: Criteria) -> tuple[float, LogEntry]:
    """A log's entry, and by how many margins its worst figure that gates got worse."""
    worse = {
        name: found
        for name, criterion in rules.metrics.items()
        if criterion.gates and (found := worsening(name, sides, criterion)) is not None
    }
    worst = max(worse, key=worse.__getitem__, default=None)
    fails = [text for name, criterion in rules.metrics.items() for text in _broken_rules(name, sides, criterion)]
    figures = {name: figure(name, sides) for name in METRICS if any(side.get(name) is not None for side in sides)}
    entry: LogEntry = {
        "log": logs[0].name,
        "candidate": logs[1].name,
        "paired_by": pair.by,
        "worst": worst if worst is not None and worse[worst] > 0 else None,
        "figures": figures,
        "fails": fails,
    }
    return -math.inf if worst is None else worse[worst], entry


def _broken_rules(name: str, sides: Sides, criterion: Criterion) -> list[str]:
    """What a figure of one log may not do and does, in words."""
    found, value = [], sides[1].get(name)
    if criterion.log_margin is not None:
        worse = worsening(name, sides, replace(criterion, margin=criterion.log_margin))
        if worse is not None and worse > 1:
            found.append(f"{name} got worse by more than {criterion.log_margin:g}")
    if value is not None and criterion.limit is not None:
        beyond = value < criterion.limit if criterion.direction == "higher" else value > criterion.limit
        found += [f"{name} is {value:.6g}, beyond its limit of {criterion.limit:g}"] if beyond else []
    return found


def _document(
    rules: Criteria,
    compared: Sequence[tuple[LogEntry, Sides]],
    unpaired: UnpairedLogs,
    broken: list[BrokenEntry],
    marks: Mapping[str, str | None],
) -> SetDocument:
    logs = [entry for entry, _ in compared]
    repeated = _repeated([entry["log"] for entry in logs], marks)
    metrics = verdicts(_joined([(marks[entry["log"]], sides) for entry, sides in compared]), rules)
    missing_fails = rules.missing == "fail" and bool(unpaired["baseline"])
    failing = [entry["fails"] for entry in metrics.values()] + [bool(log["fails"]) for log in logs]
    return {
        "verdict": overall(metrics),
        "fails": missing_fails or any(failing),
        "partial": bool(broken),
        "confidence": rules.confidence,
        "pairs": len(compared),
        "repeated": repeated,
        "unpaired": unpaired,
        "missing_fails": missing_fails,
        "broken": broken,
        "manifest": [],
        "metrics": metrics,
        "logs": logs,
        "conditions": [],
    }


def _repeated(names: Sequence[str], marks: Mapping[str, str | None]) -> list[str]:
    """The logs of a recording that another one, the first by name, is of, too."""
    seen, found = set[str | None](), []
    for name in sorted(names):
        if marks[name] is not None and marks[name] in seen:
            found.append(name)
        seen.add(marks[name])
    return found


def _joined(compared: Sequence[tuple[str | None, Sides]]) -> list[Sides]:
    """The figures of each recording by its fingerprint: the means over its logs that have them on both sides."""
    groups: dict[str | int, list[Sides]] = {}
    for row, (mark, sides) in enumerate(compared):
        groups.setdefault(row if mark is None else mark, []).append(sides)
    return [group[0] if len(group) == 1 else _mean(group) for group in groups.values()]


def _mean(group: Sequence[Sides]) -> Sides:
    means: tuple[dict[str, float | None], dict[str, float | None]] = ({}, {})
    for name in METRICS:
        pairs = [(mine.get(name), theirs.get(name)) for mine, theirs in group]
        both = [pair for pair in pairs if None not in pair] or pairs[:1]
        for side, values in zip(means, zip(*both, strict=True), strict=True):
            known = [value for value in values if value is not None]
            side[name] = sum(known) / len(known) if known else None
    return means


def _shared(rows: Sequence[ManifestRow]) -> list[SharedRow]:
    """What was meant to differ in each pair, each once with the number of pairs."""
    found: dict[str, SharedRow] = {}
    for row in rows:
        entry = found.setdefault(json.dumps(row, sort_keys=True), {**row, "logs": 0})
        entry["logs"] += 1
    return sorted(found.values(), key=lambda row: (row["key"], -row["logs"]))


def _judged(document: SetDocument, conditions: Sequence[FailCondition], *, alone: bool) -> SetDocument:
    """The document with the conditions, which decide `alone` where there are any and no criteria were given."""
    known = set_figures(document)
    document["conditions"] = [
        {"condition": condition.text, "value": condition.value(known), "holds": condition.holds(known)}
        for condition in conditions
    ]
    if alone and conditions:
        document["fails"] = document["missing_fails"] = False
        for entry in document["metrics"].values():
            entry["fails"] = False
    document["fails"] |= any(entry["holds"] for entry in document["conditions"])
    return document


def set_figures(document: SetDocument) -> dict[str, float | None]:
    """Everything that a condition may name: medians over the logs, `worst.` and `delta.` before the name, and counts.

    `worst.` is the candidate's largest value in any log, of figures that are better higher its smallest.
    """
    found: dict[str, float | None] = {
        "pairs": document["pairs"],
        "broken": len(document["broken"]),
        "missing": len(document["unpaired"]["baseline"]),
        "added": len(document["unpaired"]["candidate"]),
    }
    for name, metric in METRICS.items():
        entry = document["metrics"].get(name)
        figures = [log["figures"][name] for log in document["logs"] if name in log["figures"]]
        worst = min if metric.criterion.direction == "higher" else max
        found[name] = entry and entry["candidate"]
        found[f"baseline.{name}"] = entry and entry["baseline"]
        found[f"delta.{name}"] = _over_logs(np.median, [one["delta"] for one in figures])
        found[f"worst.{name}"] = _over_logs(worst, [one["candidate"] for one in figures])
    return found


def _over_logs(take: Callable[[list[float]], SupportsFloat], values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(take(known)) if known else None
