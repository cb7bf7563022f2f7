"""The thesis's experiment over ten seeds, from pixels: its table for its methods and for ours, and its figures."""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mcap_landmarks.evaluation.pose_metrics import Figures, axis_figures, pose_errors, position_figures
from mcap_landmarks.report.drawing import Drawing, gather
from mcap_landmarks.report.error_plots import errors_figure, positions_figure
from mcap_landmarks.report.plots import figure, save

from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import (
    PERFECT,
    STOPS,
    THESIS,
    Positions,
    at_stops,
    call,
    drawing_of,
    groups_mapped,
    record_localize,
    record_map,
    stops_of,
)
from tests.benchmark.thesis_study import study_rows

FIRST_SEED, SEEDS = 10_000, 10
_APART = 5_000  # of the seed to map and the one to localize, else their noise would be the same
_AT_ONCE = 2
METHODS = {"default": [], "thesis": THESIS}
BETKE_GURVITS, EBIED = "Betke and Gurvits, 200 positions", "Ebied and Abdel-Wahab, 143 positions"


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What one method gave on one seed: groups mapped and positions, without and with drift.

    `alone` are positions without drift that use nothing but one bundle each.
    """

    groups: int
    groups_drift: int
    perfect: Positions
    alone: Positions
    drift: Positions


def measure(
    quick: bool, first_seed: int = FIRST_SEED, model: Path | None = None, figures: Path | None = None
) -> Iterator[Row]:
    """The experiment's rows, then those of the study of section 5.2."""
    seeds = range(first_seed, first_seed + (1 if quick else SEEDS))
    words = ["--model", str(model)] if model else []
    folders = [figures if seed == first_seed else None for seed in seeds]
    with ProcessPoolExecutor(_AT_ONCE, get_context("spawn")) as pool:
        found = list(pool.map(_one_seed, seeds, repeat(words), folders))
    runs = {method: [outcome[method] for outcome in found] for method in METHODS}
    if figures is not None:
        _draw(figures, runs)
    yield from _rows(runs, len(seeds))
    yield from study_rows(first_seed, quick)


def _one_seed(seed: int, model: list[str], figures: Path | None) -> dict[str, Outcome]:
    """Record all drives, map and localize with each method, without and with drift."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        maps, asked = record_map(folder, seed, model), record_localize(folder, seed + _APART, model)
        stops = stops_of(asked[0])
        if len(stops) != STOPS:
            raise RuntimeError(f"seed {seed}: {len(stops)} stops instead of {STOPS}")
        return {method: _outcome(method, folder, maps, asked, model, figures) for method in METHODS}


def _outcome(
    method: str, folder: Path, maps: tuple[Path, Path], asked: tuple[Path, Path], model: list[str], figures: Path | None
) -> Outcome:
    """One method on the logs to map and those to localize, each without and with drift."""
    own = folder / method
    own.mkdir()
    database, built, result, alone = (own / name for name in ("map.db", "built.mcap", "result.mcap", "alone.mcap"))
    given, stops = [*METHODS[method], *model], stops_of(asked[0])
    call("map", maps[0], "--map", database, "-o", built, *given, *(PERFECT if method == "default" else []))
    groups = groups_mapped(database, maps[0], aligned=False)
    if figures is not None:
        _save(partial(figure, gather([database, built], aligned=False)[0], "Figure 5.2"), figures, "5_2", method)
    call("localize", asked[0], "--map", database, "-o", result, *given)
    perfect = by_itself = at_stops(result, stops, aligned=False)
    if method == "default":  # each bundle without what came before it; the thesis knows no other way
        call("localize", result, "--map", database, "-o", alone, *given, "--set", "localize.join_m=0")
        by_itself = at_stops(alone, stops, aligned=False)
    call("map", maps[1], "--map", database, "--overwrite", *given)
    groups_drift = groups_mapped(database, maps[0], aligned=True)
    call("localize", asked[1], "--map", database, "-o", result, "--overwrite", *given)
    return Outcome(groups, groups_drift, perfect, by_itself, at_stops(result, stops, aligned=True))


def _rows(runs: dict[str, list[Outcome]], seeds: int) -> Iterator[Row]:
    ours, theirs = runs["default"], runs["thesis"]
    perfect, alone, drift = (
        Positions.pooled([getattr(run, name) for run in ours]) for name in ("perfect", "alone", "drift")
    )
    thesis, thesis_drift = (Positions.pooled([getattr(run, name) for run in theirs]) for name in ("perfect", "drift"))
    cases = seeds * STOPS
    yield Row(
        "groups_mapped",
        float(np.mean([run.groups for run in ours])),
        "of 20",
        at_least=19.5,
        cases=seeds,
        peers={
            "thesis": float(np.mean([run.groups for run in theirs])),
            "with drift": float(np.mean([run.groups_drift for run in ours])),
        },
    )
    yield Row(
        "positions_computed",
        _computed(perfect.one_scan),
        "%",
        at_least=97,
        cases=cases,
        peers={
            "thesis": _computed(thesis.one_scan),
            "one bundle alone": _computed(alone.one_scan),
            "with drift": _computed(drift.one_scan),
        },
    )
    yield Row(
        "false_positions",
        perfect.false + alone.false + drift.false,
        "",
        at_most=0,
        cases=perfect.poses + alone.poses + drift.poses,
        peers={"thesis, %": 100 * (thesis.false + thesis_drift.false) / max(thesis.poses + thesis_drift.poses, 1)},
    )
    yield _rmse("rmse_one_scan", alone.one_scan, perfect, 0.05, {"thesis": thesis.one_scan})
    yield _rmse("rmse_stop", perfect.stop, perfect, 0.03, {"thesis": thesis.stop})
    yield _rmse("rmse_drift_aligned", drift.one_scan, drift, 0.10, {"thesis": thesis_drift.one_scan})
    yield from _table(alone, thesis)


def _computed(found: np.ndarray) -> float:
    return 100 * float(np.isfinite(found[:, 0]).mean())


def _rmse(name: str, found: np.ndarray, positions: Positions, goal_m: float, peers: dict[str, np.ndarray]) -> Row:
    def rmse_m(estimate: np.ndarray) -> float:
        value = position_figures(_errors(estimate, positions.truth))["rmse_m"]
        return float("nan") if value is None else value

    cases = int(np.isfinite(found[:, 0]).sum())
    values = {peer: rmse_m(estimate) for peer, estimate in peers.items()}
    return Row(name, rmse_m(found), "m", at_most=goal_m, cases=cases, peers=values)


def _table(ours: Positions, thesis: Positions) -> Iterator[Row]:
    """The thesis's own figures, of one scan each, beside those it printed and the studies it names (section 5.1)."""
    mine, others = _figures(ours), _figures(thesis)
    printed = {
        "mean_relative_x": {"thesis, printed": 0.34},
        "mean_relative_y": {"thesis, printed": 0.49},
        "median_abs_x": {"thesis, Appendix D": 0.0217},
        "median_abs_y": {"thesis, Appendix D": 0.0243},
        "rmse_2d": {"thesis, Appendix D": 0.106},
        "mean_abs_x": {BETKE_GURVITS: 0.0093},
        "mean_abs_y": {BETKE_GURVITS: 0.106},
        "mean_distance": {EBIED: 0.0035},
    }
    cases = int(np.isfinite(ours.one_scan[:, 0]).sum())
    for name, (value, unit) in mine.items():
        peers = {"thesis": others[name][0], **printed.get(name, {})}
        yield Row(name, value, unit, cases=cases, peers=peers)


def _figures(positions: Positions) -> dict[str, tuple[float, str]]:
    found = np.isfinite(positions.one_scan[:, 0])
    errors, truth = _errors(positions.one_scan, positions.truth), positions.truth[found]
    axes: dict[str, Figures] = {name: axis_figures(errors[:, i], truth[:, i]) for i, name in enumerate("xy")}
    figures: dict[str, tuple[float | None, str]] = {}
    for name, axis in axes.items():
        share = axis["under_5_percent"]
        figures[f"mean_relative_{name}"] = axis["mean_relative_percent"], "%"
        figures[f"under_5_percent_{name}"] = None if share is None else 100 * share, "%"
        figures[f"median_abs_{name}"] = axis["median_abs_m"], "m"
        figures[f"mean_abs_{name}"] = float(np.abs(errors[:, "xy".index(name)]).mean()) if len(errors) else None, "m"
    figures["mean_distance"] = float(np.hypot(*errors[:, :2].T).mean()) if len(errors) else None, "m"
    figures["rmse_2d"] = position_figures(errors)["rmse_m"], "m"
    return {name: (float("nan") if value is None else value, unit) for name, (value, unit) in figures.items()}


def _errors(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Errors (K, 3) of what was computed, headings left out."""
    rows = np.isfinite(found[:, 0])
    unknown = np.full((int(rows.sum()), 1), np.nan)
    return pose_errors(np.hstack([found[rows], unknown]), np.hstack([truth[rows], unknown]))


def _draw(folder: Path, runs: dict[str, list[Outcome]]) -> None:
    drawings = {
        method: drawing_of(method, Positions.pooled([run.alone for run in own])) for method, own in runs.items()
    }
    for method, drawing in drawings.items():
        if len(drawing.runs[0].scored.rows):
            _save(partial(positions_figure, drawing, "Figure 5.3"), folder, "5_3", method)
    both = Drawing(runs=tuple(run for drawing in drawings.values() for run in drawing.runs))
    _save(partial(errors_figure, both, "Figures 5.4 and 5.5"), folder, "5_4", "and_5_5")


def _save(draw: Callable[[], Figure], folder: Path, number: str, method: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"figure_{number}_{method}.png").open("wb") as stream:
        save(draw, stream, "png")


if __name__ == "__main__":
    OPTIONS = argparse.ArgumentParser(add_help=False)
    OPTIONS.add_argument("--first-seed", type=int, default=FIRST_SEED, help="of ten; below 10,000 to develop")
    OPTIONS.add_argument("--model", type=Path, help="detector instead of the bundled one")
    OPTIONS.add_argument("--figures", type=Path, help="folder to draw the thesis's figures 5.2 to 5.5 into")
    sys.exit(main(measure, __doc__ or "", OPTIONS))
