"""The page of many results: a table to sort, the worst first, the figures of the fleet, a section for each log."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from mcap_landmarks.report.page.bundle_table import STATUSES, WORDS
from mcap_landmarks.report.page.html_page import html_page
from mcap_landmarks.report.page.paged_result import PagedResult
from mcap_landmarks.report.page.result_document import KeptCounts
from mcap_landmarks.report.page.result_page import MadePage, Row, figure_rows
from mcap_landmarks.report.page.result_words import about, metres, off_by_frame, share, verdict
from mcap_landmarks.report.page.thumbnail import thumbnail
from mcap_landmarks.wording import counted

HEAD = (
    ("result", "text"),
    ("false", "number"),
    ("RMSE", "number"),
    ("localized of all", "number"),
    ("bundles", "number"),
    ("worst", "number"),
    ("heading RMSE", "number"),
    ("NEES", "number"),
    ("most failures", "text"),
)


@dataclass(frozen=True, slots=True, eq=False)
class UnreadResult:
    """A result that could not be read, by its name, and why."""

    name: str
    reason: str


def fleet_page(results: Sequence[PagedResult], unread: Sequence[UnreadResult], mark: str) -> MadePage:
    """The page of many results; those that could not be read stand above the table."""
    ordered = sorted(results, key=_badness)
    values = {
        "title": counted(len(results) + len(unread), "result"),
        "verdict": _verdict(ordered),
        "tiles": _tiles(ordered),
        "missing": [
            *(f"{one.name} could not be read: {one.reason}." for one in unread),
            *(f"Not all of {one.name} could be read: {loss}." for one in ordered for loss in one.losses),
            *filter(None, map(off_by_frame, ordered)),
        ],
        "head": HEAD,
        "rows": [_row(i, one) for i, one in enumerate(ordered)],
        "logs": [_section(one) for one in ordered],
    }
    counts: list[KeptCounts] = [{"all": len(one.bundles), "shown": 0, "detailed": 0, "pictures": 0} for one in results]
    thinned = [
        "Single bundles with their images, scans and matches are not on a page of many results; report one of them."
    ]
    page = html_page("fleet.html.j2", {**values, "thinned": thinned}, {}, mark, has_plots=False)
    return MadePage(page, counts, thinned)


def _localized(result: PagedResult) -> tuple[int, int]:
    statuses = result.evaluation["statuses"]
    if statuses is None:
        return result.evaluation["localized"], result.evaluation["bundles"]
    return statuses["localized"], sum(statuses.values())


def _noun(results: Sequence[PagedResult]) -> str:
    """What results are called: logs if all have bundles, which a map has not."""
    return "log" if all(_localized(one)[1] for one in results) else "result"


def _badness(result: PagedResult) -> tuple[float, float, float, str]:
    """The worst first: false poses, then the share that is not localized, then the error."""
    figures, (localized, whole) = result.evaluation, _localized(result)
    return (
        -(figures["false"]["share"] or 0.0),
        localized / whole if whole else 1.0,
        -(figures["position"]["rmse_m"] or 0.0),
        result.name,
    )


def _verdict(results: Sequence[PagedResult]) -> str:
    said = _counted(results)
    scored = sum(one.evaluation["scored"] for one in results)
    false = [round(one.evaluation["false"]["count"] or 0) for one in results]
    if sum(false):
        where = counted(sum(map(bool, false)), _noun(results))
        said.append(f"{sum(false)} of {scored} poses with a truth are false, in {where}.")
    elif scored:
        said.append("None is false.")
    return " ".join(said)


def _counted(results: Sequence[PagedResult]) -> list[str]:
    """How many bundles of all were localized, and how many results have none."""
    pairs = [pair for pair in map(_localized, results) if pair[1]]
    said, others = list[str](), len(results) - len(pairs)
    if pairs:
        localized, whole = (sum(column) for column in zip(*pairs, strict=True))
        logs = counted(len(pairs), "log")
        said.append(f"{localized} of {counted(whole, 'bundle')} in {logs} were localized ({share(localized, whole)}).")
    if others:
        said.append(f"{counted(others, 'result')} {'has' if others == 1 else 'have'} no bundles.")
    return said


def _tiles(results: Sequence[PagedResult]) -> list[tuple[str, str, str, bool]]:
    shares = [localized / whole for localized, whole in map(_localized, results) if whole]
    off = [one.evaluation["position"]["rmse_m"] for one in results]
    rmse = [value for value in off if value is not None]
    noun = _noun(results)
    of_them = "" if noun == "log" else f"{counted(len(shares), 'log')} with bundles"
    found: list[tuple[str, str, str, bool]] = [(f"{noun}s", str(len(results)), of_them, False)]
    if shares:
        found.append(
            ("localized of all, median log", f"{100 * median(shares):.1f} %", f"worst {100 * min(shares):.1f} %", False)
        )
        whole = sum(part == 1.0 for part in shares)
        found.append(("all bundles localized", str(whole), f"of {counted(len(shares), 'log')}", False))
    if rmse:
        found.append((f"RMSE, median {noun}", metres(median(rmse)), f"worst {metres(max(rmse))}", False))
        false = sum(bool(one.evaluation["false"]["count"]) for one in results)
        found.append(
            (f"{noun}s with false poses", str(false), f"of {counted(len(rmse), noun)} with a truth", false > 0)
        )
    return found


def _row(place: int, result: PagedResult) -> dict[str, object]:
    """The cells of the table, each with the value that it is sorted by, empty where unknown."""
    figures, (localized, whole) = result.evaluation, _localized(result)
    position, scored = figures["position"], figures["scored"]
    heading, false = figures["heading"]["rmse_deg"], figures["false"]["count"] or 0
    failures = _most_failures(result)
    cells = [
        (result.name, result.name),
        (f"{false:.0f}" if scored else "–", f"{false:.0f}" if scored else ""),
        (metres(position["rmse_m"]), _value(position["rmse_m"])),
        (share(localized, whole), f"{localized / whole:.6f}" if whole else ""),
        (str(whole), str(whole)),
        (metres(position["max_m"]), _value(position["max_m"])),
        ("–" if heading is None else f"{heading:.2f}°", _value(heading)),
        ("–" if figures["nees"] is None else f"{figures['nees']:.2f}", _value(figures["nees"])),
        (failures or "–", failures),
    ]
    return {"place": place, "cells": cells, "is_bad": bool(false)}


def _most_failures(result: PagedResult) -> str:
    statuses = {name: count for name, count in (result.evaluation["statuses"] or {}).items() if name != "localized"}
    if not any(statuses.values()):
        return ""
    name = max(statuses, key=lambda one: statuses[one])
    return f"{statuses[name]} {WORDS[STATUSES.index(name)]}"


def _value(value: float | None) -> str:
    return "" if value is None else repr(value)


def _section(result: PagedResult) -> dict[str, object]:
    rows: list[Row] = figure_rows(result)
    return {
        "name": result.name,
        "verdict": verdict(result),
        "about": about(result),
        "rows": rows,
        "missing": [f"Not all of the file could be read: {loss}." for loss in result.losses],
        "command": shlex.join(["mcap-landmarks", "report", str(result.path), "-o", f"{result.path.stem}.html"]),
        **thumbnail(result),
    }
