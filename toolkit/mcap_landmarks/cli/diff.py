"""Say what changed between two runs: two logs with results, or two landmark databases."""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import DONE, USAGE, moment, progress, say, say_json, table, warn
from mcap_landmarks.errors import ToolkitError, UsageError

DIFFERENT = 1
_SHOWN, _FIELDS = 3, 8
_LONGEST = 60
_HASH = re.compile("[0-9a-f]{32,}")


def command(
    baseline: Annotated[Path, typer.Argument(metavar="BASELINE", help="A log with results, or a MAP.db.")],
    candidate: Annotated[Path, typer.Argument(metavar="CANDIDATE", help="The same of another run.")],
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
        Path | None, typer.Option("--reference", help="Where the truth is, for a side that has none: a log, or .tum.")
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

    size = sum(path.stat().st_size for path in (baseline, candidate) if path.is_file())
    try:
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
    counts = [channel[name] for channel in found.document["channels"].values() for name in ("same", "changed")]
    if counts and not any(counts):
        remedy = "try --align" if "landmarks" in found.document["channels"] else "are they of the same recording?"
        warn(f"note: nothing of the one has its like in the other; {remedy}")
    for loss in found.losses:
        warn(f"warning: {loss}")
    if found.losses:
        warn("error: what cannot be read was not compared; recover the log first")
        raise typer.Exit(USAGE)
    raise typer.Exit(DIFFERENT if found.fails else DONE)


def _print(document: dict[str, Any]) -> None:
    channels = document["channels"]
    touched = {name: channel for name, channel in channels.items() if _differs(channel)}
    if document["identical"]:
        say("same: the files are equal byte by byte")
    elif document["verdict"] == "same":
        say(f"same: {_many(len(channels), 'channel')}, nothing beyond tolerance")
    else:
        say(f"different: {len(touched)} of {_many(len(channels), 'channel')}")
    _print_rows("meant to differ", ((row["key"], row) for row in document["manifest"]))
    _print_rows("structure", ((f"{row['what']} {row['name']}", row) for row in document["structure"]))
    if touched:
        _print_counts(touched)
    for name, channel in touched.items():
        _print_channel(name, channel)
    _print_metrics(document["metrics"])
    if document["alignment"]:
        fit = document["alignment"]
        say(f"\nbaseline from candidate: {fit['x_m']:.3f} m, {fit['y_m']:.3f} m, {fit['heading_deg']:.3f} deg")
    for entry in document["conditions"]:
        say(f"\n{'fails' if entry['holds'] else 'holds not'}: {entry['condition']} (it is {_number(entry['value'])})")


def _print_rows(head: str, rows: Iterable[tuple[str, dict[str, Any]]]) -> None:
    lines = [[_short(name), _value(row["baseline"]), _value(row["candidate"])] for name, row in rows]
    if lines:
        say()
        table([head, "baseline", "candidate"], lines)


def _print_counts(channels: dict[str, Any]) -> None:
    counts = ("same", "changed", "added", "removed")
    say()
    rows = []
    for name, channel in channels.items():
        rows.append([name, *(str(channel[count]) for count in counts), channel["unit"]])
        messages = channel["messages"]
        if any(messages[count] != channel[count] for count in ("added", "removed")):
            rows.append(["", *(str(messages[count]) for count in counts), "messages"])
    table(["channel", *counts, "counted"], rows)


def _print_channel(name: str, channel: dict[str, Any]) -> None:
    say(f"\n{name}")
    unit = channel["unit"].removesuffix("s")
    for side in ("removed", "added"):
        of = "baseline" if side == "removed" else "candidate"
        cases = [case for case in channel["worst"] if case["field"] == unit and case[of] is not None]
        if cases:
            classes = {label: counts[side] for label, counts in channel["classes"].items() if counts[side]}
            named = ", ".join(f"{label} {count}" for label, count in classes.items())
            say(f"  {side}: {channel[side]} {named and f'({named})'}".rstrip())
        for case in cases[:_SHOWN]:
            say(
                f"    {_when(case)}{', '.join(f'{key} {_value(value)}' for key, value in case[of].items())}".rstrip(
                    " :"
                )
            )
        if cases and channel[side] > _SHOWN:
            say(f"    and {channel[side] - _SHOWN} more")
    fields = list(channel["fields"].items())
    for field, entry in fields[:_FIELDS]:
        case = next(case for case in channel["worst"] if case["field"].partition("[")[0] == field)
        say(f"  {field}: {entry['changed']} changed{_how(field, entry, case)}")
    if len(fields) > _FIELDS:
        say(f"  and {len(fields) - _FIELDS} more fields: {', '.join(name for name, _ in fields[_FIELDS:])}")


def _how(field: str, entry: dict[str, Any], case: dict[str, Any]) -> str:
    """How a field changed: which words became which, else the worst case."""
    if entry["transitions"]:
        words = (
            f"{way['baseline'] or 'none'} -> {way['candidate'] or 'none'} {way['count']}"
            for way in entry["transitions"]
        )
        return ": " + ", ".join(words)
    largest = f", by {_difference(field, entry['largest'])} at most" if entry["largest"] else ""
    values = " -> ".join(_value(case[side], field) for side in ("baseline", "candidate"))
    return f"{largest}; {_when(case)}{case['field'].removeprefix(field)} {values}".replace(":  ", ": ")


def _print_metrics(metrics: dict[str, Any]) -> None:
    rows = [
        [name, *(_number(values[side]) for side in ("baseline", "candidate", "delta"))]
        for name, values in metrics.items()
        if values["baseline"] != values["candidate"] and not name.startswith("axis.")  # the thesis's own, in the JSON
    ]
    if rows:
        say()
        table(["metric", "baseline", "candidate", "change"], rows)
    elif metrics:
        say("\nthe metrics are the same")


def _differs(channel: dict[str, Any]) -> bool:
    counts = (channel, channel["messages"])
    return any(count[name] for count in counts for name in ("changed", "added", "removed"))


def _when(case: dict[str, Any]) -> str:
    parts = [moment(case["time_ns"]) if case["time_ns"] is not None else "", case["item"] or ""]
    return " ".join(part for part in parts if part) + ": "


def _value(value: Any, field: str = "") -> str:  # noqa: ANN401 - any JSON value
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


def _many(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"
