"""How `diff` tells what differs between two drives."""

from typing import TYPE_CHECKING

from mcap_landmarks.cli.console import say, table
from mcap_landmarks.cli.diff_text import number, print_metrics
from mcap_landmarks.moments import moment
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.diff.drive_document import (
        ClassRates,
        DriveDocument,
        DriveEntry,
        LandmarkEntry,
        LandmarksEntry,
        RateEntry,
        SpreadEntry,
    )

_FIELDS = 12
"""So many fields that are distributed differently are shown; the JSON has all."""
_RATE = 0.02
"""Rates that differ by less than this share are not shown."""


def print_drives(document: "DriveDocument") -> None:
    """Print what differs between two drives."""
    say("two drives: they share no messages, so they are compared by rates, distributions, classes and errors")
    say()
    sides = document["baseline"], document["candidate"]
    rows = [[name, *_drive(side)] for name, side in zip(("baseline", "candidate"), sides, strict=True)]
    table(["drive", "from", "seconds", "metres"], rows)
    _print_rates(document)
    _print_fields(document)
    statuses = {name: (row["baseline"], row["candidate"]) for name, row in document["statuses"].items()}
    rows = [[name, *map(_percent, shares)] for name, shares in statuses.items() if any(shares)]
    if rows:
        say()
        table(["status", "baseline", "candidate"], rows)
    for topic, classes in document["classes"].items():
        say()
        rows = [[name, *_rates(row["baseline"]), *_rates(row["candidate"])] for name, row in classes.items()]
        head = ["per message", "per minute", "per metre"]
        table([topic, *head, *(f"then {words}" for words in head)], rows)
    if document["landmarks"] is not None:
        _print_landmarks(document["landmarks"])
    print_metrics(document["metrics"])
    for entry in document["conditions"]:
        say()
        say(f"{'fails' if entry['holds'] else 'holds not'}: {entry['condition']} (it is {number(entry['value'])})")


def _drive(entry: "DriveEntry") -> list[str]:
    start = "-" if entry["start_ns"] is None else moment(entry["start_ns"])
    return [start, f"{entry['duration_s']:.1f}", _figure(entry["distance_m"], ".1f")]


def _print_rates(document: "DriveDocument") -> None:
    """The topics whose rate differs, that have gaps, or that only one side has."""
    rows, same = [], 0
    for topic, entry in document["channels"].items():
        mine, theirs = entry["baseline"], entry["candidate"]
        if mine and theirs and _is_alike(mine, theirs):
            same += 1
        else:
            rows.append([topic, *_rate(mine), *_rate(theirs)])
    say()
    if rows:
        head = ["messages", "Hz", "longest gap", "gaps"]
        table(["channel", *head, *(f"then {words}" for words in head)], rows)
    if same:
        say(f"{counted(same, 'channel')} of the same rate, without gaps")


def _is_alike(mine: "RateEntry", theirs: "RateEntry") -> bool:
    rates = mine["rate_hz"] or 0.0, theirs["rate_hz"] or 0.0
    return abs(rates[0] - rates[1]) <= _RATE * max(rates) and not mine["gaps"] and not theirs["gaps"]


def _rate(entry: "RateEntry | None") -> list[str]:
    if entry is None:
        return ["none", "-", "-", "-"]
    gap = _figure(entry["longest_gap_s"], ".3g")
    return [str(entry["messages"]), _figure(entry["rate_hz"], ".4g"), f"{gap} s", str(entry["gaps"])]


def _print_fields(document: "DriveDocument") -> None:
    found = [
        (topic, name, entry)
        for topic, fields in document["fields"].items()
        for name, entry in fields.items()
        if entry["verdict"] == "different"
    ]
    found.sort(key=lambda one: (one[2]["within"] - one[2]["distance"], one[0], one[1]))
    total = sum(len(fields) for fields in document["fields"].values())
    say()
    if found:
        rows = [
            [
                f"{topic} {name}",
                f"{entry['distance']:.2f}",
                f"{entry['within']:.2f}",
                *(
                    f"{side['median']:.4g} ({side['p5']:.4g} to {side['p95']:.4g})"
                    for side in (entry["baseline"], entry["candidate"])
                ),
            ]
            for topic, name, entry in found[:_FIELDS]
        ]
        table(["field, distributed differently", "distance", "within a drive", "baseline", "candidate"], rows)
    if len(found) > _FIELDS:
        say(f"  and {len(found) - _FIELDS} more; --json has all")
    say(f"{len(found)} of {counted(total, 'field')} differ more between the drives than within one of them")


def _spread(entry: "SpreadEntry") -> str:
    return f"{entry['median']:.4g} ({entry['p5']:.4g} to {entry['p95']:.4g})"


def _print_landmarks(entry: "LandmarksEntry") -> None:
    say()
    came, went = ("seen in the candidate alone", "in the baseline alone") if entry["one_map"] else ("came", "went")
    say(f"landmarks: {entry['both']} in both, {len(entry['came'])} {came}, {len(entry['went'])} {went}")
    for sign, landmarks in (("+", entry["came"]), ("-", entry["went"])):
        for landmark in landmarks:
            say(f"  {sign} {_landmark(landmark)}")


def _landmark(entry: "LandmarkEntry") -> str:
    return f"{entry['class_name']} {entry['id']} at {entry['x_m']:.2f} m, {entry['y_m']:.2f} m"


def _rates(rates: "ClassRates") -> list[str]:
    return [
        _figure(rates["per_message"], ".3f"),
        _figure(rates["per_minute"], ".1f"),
        _figure(rates["per_metre"], ".2f"),
    ]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _figure(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
