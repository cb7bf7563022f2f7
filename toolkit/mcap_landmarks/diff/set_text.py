"""A comparison of two sets of runs in words, for every form that it is told in."""

from collections.abc import Mapping

from mcap_landmarks.diff.criteria import METRICS
from mcap_landmarks.diff.set_document import LogEntry, SetDocument, VerdictEntry
from mcap_landmarks.wording import counted

FIGURE_HEAD = ("confidence", "baseline", "candidate", "change", "between", "margin", "logs")
"""The head of what `figure_cells` gives."""


def value_of(value: float | None) -> str:
    """A figure, a dash where it is unknown."""
    return "-" if value is None else f"{value:.4g}"


def change_of(change: float, *, relative: bool) -> str:
    """A change with its sign, of a ratio in percent."""
    if not change:
        return "0 %" if relative else "0"
    return f"{100 * change:+.2f} %" if relative else f"{change:+.4g}"


def change_in(entry: VerdictEntry) -> str:
    """By how much a metric changed; of one that is best at 1, how far it is from that."""
    away = " from 1" if entry["direction"] == "one" else ""
    return change_of(entry["change"], relative=entry["relative"]) + away


def interval_of(entry: VerdictEntry) -> str:
    """Between what the change lies."""
    if entry["low"] is None or entry["high"] is None:
        return "unbounded"
    relative = entry["relative"]
    low = change_of(entry["low"], relative=relative).removesuffix(" %")
    return f"{low} and {change_of(entry['high'], relative=relative)}"


def margin_of(entry: VerdictEntry) -> str:
    """Up to what a change does not matter."""
    return change_of(entry["margin"], relative=entry["relative"]).removeprefix("+")


def confidence_of(entry: VerdictEntry) -> str:
    """How sure a verdict is."""
    return "-" if entry["confidence"] is None else f"{100 * min(entry['confidence'], 0.999):.1f} %"


def telling(metrics: Mapping[str, VerdictEntry]) -> tuple[list[str], list[str]]:
    """Names of the metrics to show, those that gate first, and of the others, which are the same and do not gate."""
    shown = [name for name, entry in metrics.items() if entry["gates"]]
    shown += [name for name, entry in metrics.items() if not entry["gates"] and entry["verdict"] != "same"]
    return shown, [name for name in metrics if name not in shown]


def failures_of(document: SetDocument) -> list[tuple[str, str]]:
    """What fails: the metric, log or condition by name, and why."""
    found: list[tuple[str, str]] = [
        (name, entry["verdict"]) for name, entry in document["metrics"].items() if entry["fails"]
    ]
    found += [(log["log"], text) for log in document["logs"] for text in log["fails"]]
    if document["missing_fails"]:
        found += [(name, "missing in the candidate") for name in document["unpaired"]["baseline"]]
    holding = (one for one in document["conditions"] if one["holds"])
    return found + [(one["condition"], f"it is {value_of(one['value'])}") for one in holding]


def left_out_of(document: SetDocument) -> list[tuple[str, str]]:
    """The logs that are no pair of their own, and why."""
    found = [(name, "the candidate lacks it") for name in document["unpaired"]["baseline"]]
    found += [(name, "the baseline lacks it") for name in document["unpaired"]["candidate"]]
    found += [(name, "joined with another log of its recording") for name in document["repeated"]]
    return found + [(one["log"], f"the {one['side']}'s cannot be read") for one in document["broken"]]


def verdict_of(entry: VerdictEntry) -> str:
    """A verdict in one line."""
    change = f"{change_in(entry)} (between: {interval_of(entry)})"
    values = f"median {value_of(entry['baseline'])} -> {value_of(entry['candidate'])}"
    notes = [f"; {entry['note']}"] if entry["note"] else []
    notes += [f"; {counted(entry['lost'], 'log')} lost it"] if entry["lost"] else []
    return f"{entry['verdict']}: {change}, {values}, {counted(entry['logs'], 'log')}{''.join(notes)}"


def worst_of(log: LogEntry) -> tuple[str, str, str, str] | None:
    """Name, values of both sides and change of the figure of a log that got worse by most; None where none did."""
    name = log["worst"]
    if name is None:
        return None
    entry = log["figures"][name]
    change = entry["change"]
    told = "lost" if change is None else change_of(change, relative=METRICS[name].relative)
    return name, value_of(entry["baseline"]), value_of(entry["candidate"]), told


def figure_cells(entry: VerdictEntry) -> list[str]:
    """What a table says of a figure beside its verdict, under `FIGURE_HEAD`."""
    values = [value_of(entry["baseline"]), value_of(entry["candidate"])]
    return [confidence_of(entry), *values, change_in(entry), interval_of(entry), margin_of(entry), str(entry["logs"])]
