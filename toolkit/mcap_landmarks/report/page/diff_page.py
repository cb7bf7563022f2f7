"""The page of what changed between two runs: both overlaid, the worst changes first, each a click from its bundle."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from mcap_landmarks.diff.document import ChannelEntry, DiffDocument
from mcap_landmarks.diff.metric_rows import flat, side_by_side
from mcap_landmarks.report.page.bundle_changes import BundleChange, bundle_changes
from mcap_landmarks.report.page.html_page import html_page
from mcap_landmarks.report.page.paged_result import PagedResult
from mcap_landmarks.report.page.result_document import DrawnResult, result_document
from mcap_landmarks.report.page.result_page import MadePage, Row, status_names
from mcap_landmarks.report.page.result_words import map_words, metres, share
from mcap_landmarks.wording import counted

_SHOWN = 60
"""So many of the worst changes are listed; the strip and the map have more."""
_LONGEST = 48
"""Longer values are cut in the tables; the diff's own JSON has them whole."""
SIDES = ("baseline", "candidate")


def diff_page(
    baseline: PagedResult, candidate: PagedResult, document: DiffDocument, losses: Sequence[str], mark: str
) -> MadePage:
    """The page of two runs and the document of their diff."""
    changes = bundle_changes(baseline, candidate)
    wanted = np.array([one.stamp_ns for one in changes], dtype=np.int64)
    drawn = [result_document(side, wanted, share=0.5) for side in (baseline, candidate)]
    start_ns = min(int(str(one.document["start_ns"])) for one in drawn)
    values = {
        **map_words([baseline, candidate]),
        "is_of_maps": _landmarks(document) is not None,
        "title": f"{baseline.name} → {candidate.name}",
        "verdict": _verdict(document, changes),
        "tiles": _tiles(baseline, candidate),
        "missing": [f"Not all could be read, and what cannot be read was not compared: {loss}." for loss in losses],
        "has_map": any(len(side.bundles) or side.drawing.landmarks is not None for side in (baseline, candidate)),
        "has_errors": any(one.document["errors"] for one in drawn),
        **_listed(changes, start_ns),
        **_tables(document),
        "metrics": _metrics(document, baseline, candidate),
        "thinned": _thinned(drawn),
    }
    data = {
        "runs": _on_one_clock(drawn, start_ns),
        "statuses": status_names(),
        "sides": SIDES,
        "changes": [{"stamp": str(one.stamp_ns)} for one in changes],
        "first": str(changes[0].stamp_ns) if changes else None,
    }
    page = html_page("diff.html.j2", values, data, mark, has_plots=True)
    return MadePage(page, [one.counts for one in drawn], _thinned(drawn))


def _metrics(document: DiffDocument, baseline: PagedResult, candidate: PagedResult) -> list[list[str]]:
    """The figures of both; where a side was moved onto the truth, its figures are those behind that."""
    rows = document["metrics"]
    if baseline.evaluation["alignment"] or candidate.evaluation["alignment"]:
        rows = side_by_side(flat(baseline.evaluation), flat(candidate.evaluation))
    return [
        [name, _figure(row["baseline"]), _figure(row["candidate"]), _figure(row["delta"])] for name, row in rows.items()
    ]


def _tables(document: DiffDocument) -> dict[str, object]:
    """The tables of what the diff found: channels, single fields, and what was meant to differ."""
    channels = {name: entry for name, entry in document["channels"].items() if _differs(entry)}
    return {
        "channels": [_channel(name, entry) for name, entry in channels.items()],
        "same_channels": len(document["channels"]) - len(channels),
        "cases": [case for name, entry in channels.items() for case in _cases(name, entry)],
        "declared": [[row["key"], _cut(row["baseline"]), _cut(row["candidate"])] for row in document["manifest"]],
    }


def _on_one_clock(drawn: Sequence[DrawnResult], start_ns: int) -> list[dict[str, object]]:
    """The documents with seconds since the same moment."""
    found = []
    for one in drawn:
        late_s, document = (int(str(one.document["start_ns"])) - start_ns) / 1e9, dict(one.document)
        for part in ("bundles", "errors"):
            columns = document[part]
            if isinstance(columns, dict) and columns:
                document[part] = {**columns, "t": [second + late_s for second in columns["t"]]}
        found.append(document)
    return found


def _thinned(drawn: Sequence[DrawnResult]) -> list[str]:
    return [f"{side}: {line}" for side, one in zip(SIDES, drawn, strict=True) for line in one.thinned]


def _verdict(document: DiffDocument, changes: Sequence[BundleChange]) -> str:
    if document["identical"]:
        return "The two files are equal byte by byte."
    if document["verdict"] == "same" and not changes:
        return "The same: nothing differs beyond the tolerances of the stages."
    landmarks = _landmarks(document)
    if landmarks is not None:
        return _map_verdict(landmarks)
    kinds = Counter(one.rank for one in changes)
    farthest = max((one.moved_m or 0.0 for one in changes), default=0.0)
    told = [
        (kinds[0], "localized no more"),
        (kinds[4], "localized now"),
        (kinds[1], "false now"),
        (kinds[2], f"moved or failing otherwise, by {metres(farthest)} at most"),
        (kinds[3], "in one run only"),
    ]
    parts = [f"{count} {words}" for count, words in told if count]
    bundles = f"{counted(len(changes), 'bundle')} changed: {', '.join(parts)}." if changes else "No bundle changed."
    differing = sum(_differs(entry) for entry in document["channels"].values())
    return f"{bundles} {differing} of {counted(len(document['channels']), 'channel')} differ."


def _landmarks(document: DiffDocument) -> ChannelEntry | None:
    """What differs in the landmarks of two databases; None where logs were compared."""
    entry = document["channels"].get("landmarks")
    return entry if entry is not None and entry["type"] == "landmark" else None


def _map_verdict(landmarks: ChannelEntry) -> str:
    """How many landmarks went, came, moved and differ otherwise from one database to the other."""
    moved = landmarks["fields"]["position_m"]["changed"] if "position_m" in landmarks["fields"] else 0
    whole = landmarks["same"] + landmarks["changed"] + landmarks["removed"]
    said = (
        f"Of {counted(whole, 'landmark')} {landmarks['removed']} went and {moved} moved; {landmarks['added']} came new."
    )
    otherwise = landmarks["changed"] - moved
    return f"{said} {otherwise} differ otherwise." if otherwise else said


def _tiles(baseline: PagedResult, candidate: PagedResult) -> list[tuple[str, str, str, bool]]:
    """The first figures of both, and whether they became worse."""
    mine, theirs = baseline.evaluation, candidate.evaluation
    found = []
    if mine["statuses"] is not None and theirs["statuses"] is not None:
        both = mine["statuses"], theirs["statuses"]
        counts = [statuses["localized"] for statuses in both]
        words = [share(statuses["localized"], sum(statuses.values())) for statuses in both]
        found.append(("localized of all", words[1], f"was {words[0]}", counts[1] < counts[0]))
    if mine["scored"] and theirs["scored"]:
        for name, key in (("position RMSE", "rmse_m"), ("median", "median_m"), ("worst position", "max_m")):
            before, after = mine["position"][key], theirs["position"][key]
            is_worse = (after or 0.0) > 1.05 * (before or 0.0)
            found.append((name, metres(after), f"was {metres(before)}", is_worse))
        false = [round(side["false"]["count"] or 0) for side in (mine, theirs)]
        found.append(("false poses", str(false[1]), f"was {false[0]}", false[1] > false[0]))
    return found


def _listed(changes: Sequence[BundleChange], start_ns: int) -> dict[str, object]:
    """The rows of the worst changes, and how many of all these are."""
    rows = [_change(one, start_ns) for one in changes[:_SHOWN]]
    return {"changes": rows, "changes_words": f"The worst {len(rows)} of {counted(len(changes), 'changed bundle')}."}


def _change(one: BundleChange, start_ns: int) -> dict[str, object]:
    return {
        "stamp": str(one.stamp_ns),
        "cells": [
            f"{(one.stamp_ns - start_ns) / 1e9:.2f} s",
            one.words,
            *(metres(value) for value in (one.moved_m, *one.off_m)),
        ],
    }


def _differs(entry: ChannelEntry) -> bool:
    counts = (entry, entry["messages"])
    return any(count["changed"] or count["added"] or count["removed"] for count in counts)


def _channel(name: str, entry: ChannelEntry) -> Row:
    fields = ", ".join(f"{field} ({told['changed']})" for field, told in list(entry["fields"].items())[:4])
    counts = [str(count) for count in (entry["same"], entry["changed"], entry["added"], entry["removed"])]
    return [name, *counts, entry["unit"], fields]


def _cases(name: str, entry: ChannelEntry) -> list[dict[str, object]]:
    """The worst differences of a channel's fields, each with the stamp that it belongs to."""
    return [
        {
            "stamp": "" if case["time_ns"] is None else str(case["time_ns"]),
            "cells": [name, case["field"], case["item"] or "–", _cut(case["baseline"]), _cut(case["candidate"])],
        }
        for case in entry["worst"][:5]
    ]


def _cut(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        text = ", ".join(_cut(item) for item in value)
    elif isinstance(value, dict):
        text = ", ".join(f"{key} {_cut(item)}" for key, item in value.items())
    else:
        text = str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _figure(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
