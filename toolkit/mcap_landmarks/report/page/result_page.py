"""The page of one result: its tables, and the data that its script draws."""

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mcap_landmarks.evaluation.pose_metrics import Figures
from mcap_landmarks.evaluation.thesis_results import results_of
from mcap_landmarks.manifest import RUN, stage_records
from mcap_landmarks.report.page.bundle_table import HINTS, STATUSES, WORDS
from mcap_landmarks.report.page.chosen_bundles import evenly
from mcap_landmarks.report.page.html_page import html_page
from mcap_landmarks.report.page.paged_result import PagedResult
from mcap_landmarks.report.page.result_document import KeptCounts, result_document
from mcap_landmarks.report.page.result_words import TIMINGS, about, map_words, metres, missing, share, verdict
from mcap_landmarks.report.page.stage_seconds import StageSeconds

_POSITIONS = 200
"""So many positions of the thesis's table are on the page; `evaluate --thesis` writes all."""
_THESIS = ("0.34 %", "0.49 %"), ("10 mm", "15 mm")
"""The thesis's own mean relative and median absolute errors along x and y (section 5.1)."""
Row = list[str]


class MadePage(NamedTuple):
    """A page, how much of each of its results is on it, and what was thinned, in words."""

    content: bytes
    counts: list[KeptCounts]
    thinned: list[str]


def result_page(result: PagedResult, mark: str, seconds: StageSeconds) -> MadePage:
    """The page of a result; see `html_page` for the mark."""
    document, counts, thinned = result_document(result)
    values = {
        **map_words([result]),
        "title": result.name,
        "verdict": verdict(result),
        "about": about(result),
        "tiles": tiles(result),
        "missing": missing(result, result.losses),
        "has_map": bool(len(result.bundles) or result.drawing.landmarks is not None or result.drawing.runs),
        "has_errors": bool(document["errors"]),
        "figures": figure_rows(result),
        **_thesis(result),
        **_detector(result),
        **_map(result),
        **made(result.manifest, seconds),
        "thinned": thinned,
    }
    data = {"runs": [document], "statuses": status_names(), "first": _first(document)}
    return MadePage(html_page("result.html.j2", values, data, mark, has_plots=True), [counts], thinned)


def status_names() -> list[dict[str, str]]:
    """The statuses as the page's script knows them."""
    return [
        {"name": name, "words": words, "hint": hint} for name, words, hint in zip(STATUSES, WORDS, HINTS, strict=True)
    ]


def _first(document: Mapping[str, object]) -> str | None:
    """The bundle to begin with: the first failure, else the first that has most to show."""
    bundles = document["bundles"]
    assert isinstance(bundles, dict)  # noqa: S101 - see result_document
    stamps, statuses, details = bundles["stamp"], bundles["status"], bundles["detail"]
    for fits in (lambda status: 1 <= status <= 5, lambda _status: True):
        for stamp, status, detail in zip(stamps, statuses, details, strict=True):
            if fits(status) and detail is not None:
                return str(stamp)
    return None


def tiles(result: PagedResult) -> list[tuple[str, str, str, bool]]:
    """The figures that one looks for first: name, value, what it is of, and whether it is bad."""
    figures, found = result.evaluation, list[tuple[str, str, str, bool]]()
    statuses, position = figures["statuses"], figures["position"]
    if statuses is not None:
        whole = sum(statuses.values())
        found.append(("localized", share(statuses["localized"], whole), f"{statuses['localized']} of {whole}", False))
    if figures["eligible"] is not None:
        found.append(("two objects or more", str(figures["eligible"]), f"of {figures['bundles']} bundles", False))
    if figures["scored"]:
        false = round(figures["false"]["count"] or 0)
        found += [
            ("position RMSE", metres(position["rmse_m"]), f"median {metres(position['median_m'])}", False),
            ("worst position", metres(position["max_m"]), f"95 % within {metres(position['p95_m'])}", False),
            ("false poses", str(false), f"of {figures['scored']} with a truth", false > 0),
        ]
        if figures["heading"]["rmse_deg"] is not None:
            middle = f"median {figures['heading']['median_deg']:.2f}°"
            found.append(("heading RMSE", f"{figures['heading']['rmse_deg']:.2f}°", middle, False))
        if figures["nees"] is not None:
            found.append(("NEES", f"{figures['nees']:.2f}", "1 is honest, more is too sure", figures["nees"] > 3.0))
    return found


def figure_rows(result: PagedResult) -> list[Row]:
    """All that an evaluation tells beside the tiles; nothing where nothing was measured."""
    figures = result.evaluation
    rows: list[Row] = [["bundles", str(figures["bundles"])]] if figures["bundles"] else []
    if figures["scored"]:
        position = figures["position"]
        rows += [
            ["poses with a truth", str(figures["scored"])],
            ["within 0.2 m", _percent(position["within_0_2_m"])],
            ["within 1 m", _percent(position["within_1_m"])],
            ["RPE from pose to pose", metres(figures["rpe"])],
        ]
    if figures["map"] is not None:
        rows += _map_rows(figures["map"])
    if figures["alignment"] is not None:
        fit = figures["alignment"]
        rows.append(["truth from estimate", f"{fit['x_m']:.3f} m, {fit['y_m']:.3f} m, {fit['heading_deg']:.3f}°"])
    return rows


def _map_rows(figures: Figures) -> list[Row]:
    counts = [f"{figures[name]:.0f} {name}" for name in ("matched", "missing", "spurious")]
    off = f"{metres(figures['rmse_m'])}, {metres(figures['rmse_aligned_m'])} after a fit"
    return [["map against the true objects", ", ".join(counts)], ["map RMSE", off]]


def _thesis(result: PagedResult) -> dict[str, object]:
    """The thesis's figures beside its own, and its table of positions."""
    drawn, axes = result.drawn, result.evaluation["axis"]
    if drawn is None or not len(drawn.scored.rows):
        return {"thesis": [], "positions": [], "positions_note": ""}
    x, y = axes["x"], axes["y"]
    rows = [
        ["median error", metres(x["median_abs_m"]), metres(y["median_abs_m"])],
        ["the thesis's", *_THESIS[1]],
        ["mean relative error", _of_truth(x["mean_relative_percent"]), _of_truth(y["mean_relative_percent"])],
        ["the thesis's", *_THESIS[0]],
        ["largest relative error", _of_truth(x["max_relative_percent"]), _of_truth(y["max_relative_percent"])],
        ["under 5 %", _percent(x["under_5_percent"]), _percent(y["under_5_percent"])],
    ]
    results = results_of(result.run, drawn.scored)
    count = len(results.classes)
    kept = evenly(np.arange(count), _POSITIONS).tolist()
    positions = [
        [", ".join(results.classes[i]), *(f"{v:.4f}" for v in (*results.reference_xy[i], *results.estimate_xy[i]))]
        for i in kept
    ]
    note = "" if len(kept) == count else f": {len(kept)} of {count}, evenly; evaluate --thesis FILE writes all"
    return {"thesis": rows, "positions": positions, "positions_note": note}


def _detector(result: PagedResult) -> dict[str, object]:
    found = result.detector
    if found is None:
        return {"detector": [], "detector_words": "", "detector_head": []}
    head = ["class", "boxes", "median confidence", "middle half"]
    rows = [
        [one.name, str(one.boxes), f"{one.quartiles[1]:.2f}", f"{one.quartiles[0]:.2f} to {one.quartiles[2]:.2f}"]
        for one in found.classes
    ]
    words = f"{sum(one.boxes for one in found.classes)} boxes in {found.images} images; {found.empty} images have none."
    if found.with_truth:
        head += ["true of them", "missed"]
        for row, one in zip(rows, found.classes, strict=True):
            row += [share(one.true, one.judged), share(one.missed, one.true + one.missed)]
        words += f" Held against the truth of {found.with_truth} images: a box is true if it overlaps one of its class"
        words += " by half."
    else:
        words += " The log has no true boxes to hold them against."
    return {"detector": rows, "detector_words": words, "detector_head": head}


def _map(result: PagedResult) -> dict[str, object]:
    scene = result.drawing.landmarks
    if scene is None:
        return {"landmarks": [], "landmarks_words": "", "map_words": ""}
    seen = [name for names in result.run.seen.values() for name in names]
    counts = {name: seen.count(name) for name in set(seen)} if len(scene) < 5000 else {}
    rows = []
    for i in range(min(len(scene), 1000)):
        spread = scene.covariances[i]
        sigma = metres(float(np.sqrt(np.linalg.eigvalsh(spread)[-1]))) if spread.any() else "–"
        x, y = scene.positions_xy[i].tolist()
        rows.append([scene.ids[i], scene.classes[i], f"{x:.3f}", f"{y:.3f}", sigma, str(counts.get(scene.ids[i], 0))])
    words = f"{len(scene)} landmarks" + ("" if len(rows) == len(scene) else f", the first {len(rows)} of them here")
    unused = sum(name not in counts for name in scene.ids)
    told = f"{unused} of {len(scene)} landmarks were never matched." if result.run.seen and unused else ""
    return {"landmarks": rows, "landmarks_words": words, "map_words": told}


def made(manifest: Mapping[str, str] | None, seconds: StageSeconds) -> dict[str, object]:
    """The manifest entry by entry, a row per stage, and how long each took, or why that is not known."""
    timings = f"The stages that ran took {sum(seconds.values()):.1f} s." if seconds else TIMINGS
    if not manifest:
        return {"timings": f"{timings} The file has no manifest.", "stages": [], "manifest": []}
    rows = []
    for record in stage_records({RUN: manifest}).values():
        told = record.outcome
        kinds = (
            ", ".join(f"{count} {what}" for what, count in counts.items()) for counts in (told.counts, told.dropped)
        )
        took = f"{seconds[record.stage]:.1f}" if record.stage in seconds else "–"
        rows.append([record.stage, took, str(told.bundles), str(told.unreadable), *(text or "–" for text in kinds)])
    return {
        "timings": timings,
        "stages": rows,
        "manifest": [(name, _pretty(text)) for name, text in sorted(manifest.items())],
    }


def _pretty(text: str) -> str:
    try:
        return json.dumps(json.loads(text), indent=2, ensure_ascii=False, sort_keys=True)
    except (ValueError, RecursionError):
        return text


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _of_truth(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f} %"
