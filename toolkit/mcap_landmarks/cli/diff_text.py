"""How `diff` tells what changed between two logs or two landmark databases."""

import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

from mcap_landmarks.cli.console import say, table, warn
from mcap_landmarks.moments import moment
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.diff.comparison import Diff
    from mcap_landmarks.diff.document import CaseEntry, ChannelEntry, DiffDocument, FieldEntry, MetricEntry

DIFFERENT = 1
"""The exit code where the two are not the same."""
_SHOWN, _FIELDS = 3, 8
"""So many additions, removals and fields of a channel are shown; the JSON has all."""
_LONGEST = 60
"""Longer texts are cut, so that a line of the table fits a terminal."""
_HASH = re.compile("[0-9a-f]{32,}")


def warn_of(found: "Diff") -> None:
    """Say on stderr what could not be compared."""
    channels = found.document["channels"]
    if channels and not any(channel["same"] or channel["changed"] for channel in channels.values()):
        remedy = "try --align" if "landmarks" in channels else "are they of the same recording?"
        warn(f"note: nothing of the one has its like in the other; {remedy}")
    warn_losses(found.losses)


def warn_losses(losses: Sequence[str]) -> None:
    """Say on stderr what could not be read."""
    for loss in losses:
        warn(f"warning: {loss}")
    if losses:
        warn("error: what cannot be read was not compared; recover the log first")


def print_diff(document: "DiffDocument") -> None:
    """Print a diff."""
    channels = document["channels"]
    touched = {name: channel for name, channel in channels.items() if _differs(channel)}
    if document["identical"]:
        say("same: the files are equal byte by byte")
    elif document["verdict"] == "same":
        say(f"same: {counted(len(channels), 'channel')}, nothing beyond tolerance")
    else:
        say(f"different: {len(touched)} of {counted(len(channels), 'channel')}")
    print_rows("meant to differ", ((row["key"], row["baseline"], row["candidate"]) for row in document["manifest"]))
    structure = document["structure"]
    print_rows("structure", ((f"{row['what']} {row['name']}", row["baseline"], row["candidate"]) for row in structure))
    if touched:
        _print_counts(touched)
    for name, channel in touched.items():
        _print_channel(name, channel)
    print_metrics(document["metrics"])
    if document["alignment"]:
        fit = document["alignment"]
        say()
        say(f"baseline from candidate: {fit['x_m']:.3f} m, {fit['y_m']:.3f} m, {fit['heading_deg']:.3f} deg")
    for entry in document["conditions"]:
        say()
        say(f"{'fails' if entry['holds'] else 'holds not'}: {entry['condition']} (it is {number(entry['value'])})")


def print_rows(head: str, rows: Iterable[tuple[str, object, object]]) -> None:
    """Print names with the values of both sides, if there are any."""
    lines = [[short(name), value_text(baseline), value_text(candidate)] for name, baseline, candidate in rows]
    if lines:
        say()
        table([head, "baseline", "candidate"], lines)


def _print_counts(channels: "dict[str, ChannelEntry]") -> None:
    from mcap_landmarks.diff.document import COUNTS

    say()
    rows = []
    for name, channel in channels.items():
        rows.append([name, *(str(channel[count]) for count in COUNTS), channel["unit"]])
        messages = channel["messages"]
        if messages["added"] != channel["added"] or messages["removed"] != channel["removed"]:
            rows.append(["", *(str(messages[count]) for count in COUNTS), "messages"])
    table(["channel", *COUNTS, "counted"], rows)


def _print_channel(name: str, channel: "ChannelEntry") -> None:
    say()
    say(name)
    unit = channel["unit"].removesuffix("s")
    alone = [case for case in channel["worst"] if case["field"] == unit]
    _print_alone("removed", channel, [(case, case["baseline"]) for case in alone])
    _print_alone("added", channel, [(case, case["candidate"]) for case in alone])
    _print_fields(channel)


def _print_alone(
    side: Literal["removed", "added"], channel: "ChannelEntry", cases: "Iterable[tuple[CaseEntry, object]]"
) -> None:
    """What only one side has, with the values of the first; those that lie on the other side have none here."""
    first = [(case, values) for case, values in cases if isinstance(values, dict)]
    if not first:
        return
    counts = {label: entry[side] for label, entry in channel["classes"].items()}
    named = ", ".join(f"{label} {count}" for label, count in counts.items() if count)
    say(f"  {side}: {channel[side]} {named and f'({named})'}".rstrip())
    for case, values in first[:_SHOWN]:
        told = ", ".join(f"{key} {value_text(value)}" for key, value in values.items())
        say(f"    {_when(case)}{told}".rstrip(" :"))
    if channel[side] > _SHOWN:
        say(f"    and {channel[side] - _SHOWN} more")


def _print_fields(channel: "ChannelEntry") -> None:
    fields = list(channel["fields"].items())
    for field, entry in fields[:_FIELDS]:
        case = next(case for case in channel["worst"] if case["field"].partition("[")[0] == field)
        say(f"  {field}: {entry['changed']} changed{_how(field, entry, case)}")
    if len(fields) > _FIELDS:
        say(f"  and {len(fields) - _FIELDS} more fields: {', '.join(name for name, _ in fields[_FIELDS:])}")


def _how(field: str, entry: "FieldEntry", case: "CaseEntry") -> str:
    """How a field changed: which words became which, else the worst case."""
    if entry["transitions"]:
        words = (
            f"{way['baseline'] or 'none'} -> {way['candidate'] or 'none'} {way['count']}"
            for way in entry["transitions"]
        )
        return ": " + ", ".join(words)
    largest = f", by {_difference(field, entry['largest'])} at most" if entry["largest"] else ""
    values = f"{value_text(case['baseline'], field)} -> {value_text(case['candidate'], field)}"
    return f"{largest}; {_when(case)}{case['field'].removeprefix(field)} {values}".replace(":  ", ": ")


def print_metrics(metrics: "dict[str, MetricEntry]") -> None:
    """Print the figures that differ."""
    rows = [
        [name, number(values["baseline"]), number(values["candidate"]), number(values["delta"])]
        for name, values in metrics.items()
        if values["baseline"] != values["candidate"] and not name.startswith("axis.")  # the thesis's own, in the JSON
    ]
    if rows:
        say()
        table(["metric", "baseline", "candidate", "change"], rows)
    elif metrics:
        say()
        say("the metrics are the same")


def _differs(channel: "ChannelEntry") -> bool:
    return any(count["changed"] or count["added"] or count["removed"] for count in (channel, channel["messages"]))


def _when(case: "CaseEntry") -> str:
    parts = [moment(case["time_ns"]) if case["time_ns"] is not None else "", case["item"] or ""]
    return " ".join(part for part in parts if part) + ": "


def value_text(value: object, field: str = "") -> str:
    """A value of a side as it is shown; `field` says of what."""
    if value is None:
        return "-"
    if isinstance(value, list):
        if field.endswith(("orientation", "rotation")) and len(value) == 4:
            return _heading(value)
        return short(", ".join(value_text(item) for item in value)) or "none"
    text = number(value) if isinstance(value, int | float) else str(value)
    return short(text)


def short(text: str) -> str:
    """A text that fits a table."""
    text = _HASH.sub(lambda found: f"{found[0][:12]}...", text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _heading(quaternion: list[float]) -> str:
    x, y, z, w = quaternion
    heading_deg = math.degrees(math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z))
    return f"heading {heading_deg:.3f} deg" if any(quaternion) else "no heading"


def _difference(field: str, value: float) -> str:
    if field.endswith(("orientation", "rotation", "_rad")):
        return f"{number(math.degrees(value))} deg"
    unit = next((unit for unit in ("m", "px", "ns") if field.endswith(f"_{unit}")), "")
    return f"{number(value)} {unit}".rstrip()


def number(value: float | None) -> str:
    """A figure, a dash where it is unknown."""
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.6g}"
