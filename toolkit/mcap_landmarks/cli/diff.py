"""Say what changed between two runs: two logs with results, or two landmark databases."""

import math
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import DONE, USAGE, progress, say, say_json, table, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.locations import Location, location, size_of
from mcap_landmarks.moments import moment
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.diff.comparison import Diff
    from mcap_landmarks.diff.document import CaseEntry, ChannelEntry, DiffDocument, FieldEntry, MetricEntry

DIFFERENT = 1
_SHOWN, _FIELDS = 3, 8
"""So many additions, removals and fields of a channel are shown; the JSON has all."""
_LONGEST = 60
"""Longer texts are cut, so that a line of the table fits a terminal."""
_HASH = re.compile("[0-9a-f]{32,}")


@reading_logs
def command(
    baseline: Annotated[
        Location, typer.Argument(metavar="BASELINE", parser=location, help="A log with results, or a MAP.db.")
    ],
    candidate: Annotated[
        Location, typer.Argument(metavar="CANDIDATE", parser=location, help="The same of another run.")
    ],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            "--tolerance",
            metavar="CHANNEL.FIELD=VALUE",
            help="How far a field may differ: 0.01, 1% or 0.01+1%; repeatable. Else as the stage declares.",
        ),
    ] = None,
    fail_on: Annotated[
        list[str] | None,
        typer.Option(
            "--fail-on",
            metavar="CONDITION",
            help="Exit 1 if and only if one of these holds, such as 'position.rmse_m > 0.05', 'delta.position.rmse_m "
            "> 0.01' or 'channels./landmarks/pose.removed > 0'; repeatable.",
        ),
    ] = None,
    reference: Annotated[
        Location | None,
        typer.Option(
            "--reference", parser=location, help="Where the truth is, for a side that has none: a log, or .tum."
        ),
    ] = None,
    align: Annotated[
        bool, typer.Option("--align", help="Of databases: move the candidate by the one SE(2) that fits best.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Say what changed from BASELINE to CANDIDATE. Exit code 0: the same, 1: different, 2: an error.

    Messages are paired by channel and time stamp, detections by overlap and class, objects and landmarks by position
    and class. What the manifests say was meant to differ does not count as a difference.
    """
    from mcap_landmarks.diff.comparison import diff
    from mcap_landmarks.diff.conditions import parse

    try:
        size = size_of(baseline) + size_of(candidate)
        conditions = [parse(text) for text in fail_on or []]
        with progress("compare", size) as advance:
            limits, truth = tolerance or [], reference
            found = diff(baseline, candidate, limits, conditions, reference=truth, aligned=align, progress=advance)
    except ToolkitError as error:
        raise UsageError(str(error)) from error  # 1 means different, so that every error is 2
    if json:
        say_json("diff", found.document)
    else:
        _print(found.document)
    _warn(found)
    if found.losses:
        raise typer.Exit(USAGE)
    raise typer.Exit(DIFFERENT if found.fails else DONE)


def _warn(found: "Diff") -> None:
    channels = found.document["channels"]
    if channels and not any(channel["same"] or channel["changed"] for channel in channels.values()):
        remedy = "try --align" if "landmarks" in channels else "are they of the same recording?"
        warn(f"note: nothing of the one has its like in the other; {remedy}")
    for loss in found.losses:
        warn(f"warning: {loss}")
    if found.losses:
        warn("error: what cannot be read was not compared; recover the log first")


def _print(document: "DiffDocument") -> None:
    channels = document["channels"]
    touched = {name: channel for name, channel in channels.items() if _differs(channel)}
    if document["identical"]:
        say("same: the files are equal byte by byte")
    elif document["verdict"] == "same":
        say(f"same: {counted(len(channels), 'channel')}, nothing beyond tolerance")
    else:
        say(f"different: {len(touched)} of {counted(len(channels), 'channel')}")
    _print_rows("meant to differ", ((row["key"], row["baseline"], row["candidate"]) for row in document["manifest"]))
    structure = document["structure"]
    _print_rows("structure", ((f"{row['what']} {row['name']}", row["baseline"], row["candidate"]) for row in structure))
    if touched:
        _print_counts(touched)
    for name, channel in touched.items():
        _print_channel(name, channel)
    _print_metrics(document["metrics"])
    if document["alignment"]:
        fit = document["alignment"]
        say()
        say(f"baseline from candidate: {fit['x_m']:.3f} m, {fit['y_m']:.3f} m, {fit['heading_deg']:.3f} deg")
    for entry in document["conditions"]:
        say()
        say(f"{'fails' if entry['holds'] else 'holds not'}: {entry['condition']} (it is {_number(entry['value'])})")


def _print_rows(head: str, rows: Iterable[tuple[str, object, object]]) -> None:
    lines = [[_short(name), _value(baseline), _value(candidate)] for name, baseline, candidate in rows]
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
        told = ", ".join(f"{key} {_value(value)}" for key, value in values.items())
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
    values = f"{_value(case['baseline'], field)} -> {_value(case['candidate'], field)}"
    return f"{largest}; {_when(case)}{case['field'].removeprefix(field)} {values}".replace(":  ", ": ")


def _print_metrics(metrics: "dict[str, MetricEntry]") -> None:
    rows = [
        [name, _number(values["baseline"]), _number(values["candidate"]), _number(values["delta"])]
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


def _value(value: object, field: str = "") -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        if field.endswith(("orientation", "rotation")) and len(value) == 4:
            return _heading(value)
        return _short(", ".join(_value(item) for item in value)) or "none"
    text = _number(value) if isinstance(value, int | float) else str(value)
    return _short(text)


def _short(text: str) -> str:
    text = _HASH.sub(lambda found: f"{found[0][:12]}...", text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _heading(quaternion: list[float]) -> str:
    x, y, z, w = quaternion
    heading_deg = math.degrees(math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z))
    return f"heading {heading_deg:.3f} deg" if any(quaternion) else "no heading"


def _difference(field: str, value: float) -> str:
    if field.endswith(("orientation", "rotation", "_rad")):
        return f"{_number(math.degrees(value))} deg"
    unit = next((unit for unit in ("m", "px", "ns") if field.endswith(f"_{unit}")), "")
    return f"{_number(value)} {unit}".rstrip()


def _number(value: float | None) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.6g}"
