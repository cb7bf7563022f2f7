"""Positions against the truth, and box plots of their errors: the thesis's figures 5.3 to 5.5."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.report.drawing import Drawing, Run

_TRUTH, _COMPUTED, _LINK = "#1D4ED8", "#DC2626", "#9CA3AF"


def positions_figure(drawing: Drawing, title: str = "") -> Figure:
    """True positions as blue crosses and computed ones as red crosses, each pair joined (figure 5.3); metres.

    Raises:
        RecordingError: no position has a truth.
    """
    runs = _scored(drawing)
    truth = np.concatenate([run.scored.reference[:, :2] for run in runs])
    width, height = np.maximum(np.ptp(truth, axis=0), 1.0)
    result = Figure(figsize=(7.0, 7.0 * float(np.clip(height / width, 0.45, 1.2)) + 0.5))
    axes = result.add_subplot()
    found = np.concatenate([run.scored.estimate[:, :2] for run in runs])
    axes.add_collection(LineCollection(list(np.stack([truth, found], axis=1)), colors=_LINK, linewidths=0.8, zorder=2))
    axes.plot(*truth.T, "+", color=_TRUTH, markersize=8, markeredgewidth=1.2, label="ground truth", zorder=3)
    axes.plot(*found.T, "x", color=_COMPUTED, markersize=6, markeredgewidth=1.2, label="computed", zorder=4)
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.06)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False, borderaxespad=0)
    _finish(axes, title)
    return result


def errors_figure(drawing: Drawing, title: str = "") -> Figure:
    """Box plots of the errors along x and along y, one box per run (figures 5.4 and 5.5); metres.

    Boxes hold the middle half, whiskers reach to the last error within 1.5 times its width; the number above a box is
    that of its line, the median.

    Raises:
        RecordingError: no position has a truth.
    """
    runs = _scored(drawing)
    result = Figure(figsize=(7.0, 1.6 + 1.1 * len(runs)))
    panels = result.subplots(1, 2, sharex=True, sharey=True)
    for axes, axis, name in zip(panels, (0, 1), "xy", strict=True):
        errors = [run.scored.estimate[:, axis] - run.scored.reference[:, axis] for run in runs]
        boxes = axes.boxplot(
            errors,
            orientation="horizontal",
            tick_labels=[run.name for run in runs],
            widths=0.5,
            patch_artist=True,
            boxprops={"facecolor": "#DBEAFE", "edgecolor": _TRUTH},
            whiskerprops={"color": _TRUTH},
            capprops={"color": _TRUTH},
            medianprops={"color": _COMPUTED, "linewidth": 1.4},
            flierprops={"marker": "o", "markersize": 3, "markeredgecolor": _LINK},
        )
        for median in boxes["medians"]:
            x, y = median.get_xydata()[0]
            place = (float(x), float(y))
            text = f"{x:+.4f} m"
            axes.annotate(text, place, (0, 3), textcoords="offset points", ha="center", fontsize=7, color="#374151")
        axes.axvline(0.0, color=_LINK, linewidth=0.8, zorder=0)
        axes.xaxis.set_major_locator(MaxNLocator(5))  # more labels of millimetres run into each other
        axes.set_xlabel(f"error in {name} [m]")
        _finish(axes, title if axis == 0 else "")
    panels[0].invert_yaxis()
    return result


def _scored(drawing: Drawing) -> list[Run]:
    runs = [run for run in drawing.runs if len(run.scored.rows)]
    if not runs:
        raise RecordingError("no position has a truth to compare with; take a log with /ground_truth, or show the map")
    return runs


def _finish(axes: Axes, title: str) -> None:
    axes.grid(color="#E5E7EB", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if title:
        axes.set_title(title, loc="left", color="#111827", fontsize=11, fontweight="bold")
