"""The plot of a map: landmarks by class with their uncertainty, trajectories, positions and their errors."""

import warnings
from collections import Counter
from collections.abc import Callable
from typing import BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.figure import Figure

from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.pose_metrics import FALSE_M
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.locations import Location
from mcap_landmarks.maps.model import Group
from mcap_landmarks.report.drawing import Drawing, Run, breaks, follows, regions_95, waypoints

FORMATS = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}, "pdf": {"CreationDate": None}}
"""Formats, and the metadata of each that would tell the clock or the program's version."""
_MARKED = {"png": "Description", "svg": "Description", "pdf": "Subject"}
"""Where each format's metadata has room for a text."""

_PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195", "#4D4D4D")  # Okabe, Ito 2008
_MARKERS = "osD^vPXp"
_TRUTH, _GROUP, _ERROR = "#8A8F98", "#6B7280", "#DC2626"
_RUNS = ("#111827", "#1D4ED8", "#B45309", "#047857", "#7E22CE")
_ARROWS = 12
"""So many headings along a path can be told from each other at the size of a page."""
_MOST_LABELS = 60
"""Of more landmarks the labels would cover each other at the size of a page."""


def form_of(path: Location) -> str:
    """The format that a file's name asks for.

    Raises:
        UsageError: it asks for none of them.
    """
    form = path.suffix.lower().removeprefix(".")
    if form not in FORMATS:
        known = ", ".join(f".{name}" for name in FORMATS)
        raise UsageError(f"{path}: the name does not tell the format; use {known}")
    return form


def save(draw: Callable[[], Figure], stream: BinaryIO, form: str, mark: str = "") -> None:
    """Draw a figure into a stream as `png`, `svg` or `pdf`, with a mark in its metadata. Same figure, same bytes."""
    metadata = {**FORMATS[form], **({_MARKED[form]: mark} if mark else {})}
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mpl.rcdefaults()
        set_style()
        draw().savefig(stream, format=form, metadata=metadata, bbox_inches="tight", pad_inches=0.1)


def set_style() -> None:
    """Make everything that is drawn from now on look alike."""
    mpl.rc("font", size=9)
    mpl.rc("axes", edgecolor="#9CA3AF", labelcolor="#374151", linewidth=0.8)
    mpl.rc("xtick", color="#6B7280")
    mpl.rc("ytick", color="#6B7280")
    mpl.rc("svg", hashsalt="mcap-landmarks")
    mpl.rc("savefig", dpi=200)


def figure(drawing: Drawing, title: str = "") -> Figure:
    """The figure of a drawing, in metres, axes of equal scale."""
    result = Figure(figsize=_size(drawing))
    axes = result.add_subplot()
    _draw_map(axes, drawing)
    for run in drawing.runs:
        _draw_truth(axes, run)
    for number, run in enumerate(drawing.runs):
        _draw_estimate(axes, run, _RUNS[number % len(_RUNS)], named=len(drawing.runs) > 1)
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.06)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(color="#E5E7EB", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if title:
        axes.set_title(title, loc="left", color="#111827", fontsize=11, fontweight="bold")
    handles, labels = axes.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    axes.legend(
        unique.values(), unique.keys(), loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False, borderaxespad=0
    )
    return result


def _size(drawing: Drawing) -> tuple[float, float]:
    """Inches that suit the shape of what is drawn."""
    clouds = [scene.positions_xy for scene in (drawing.landmarks, drawing.objects) if scene is not None]
    clouds += [run.estimate.poses[:, :2] for run in drawing.runs]
    clouds += [run.truth.poses[:, :2] for run in drawing.runs if run.truth is not None]
    points = np.concatenate(clouds)
    width, height = np.maximum(np.ptp(points, axis=0), 1.0) if len(points) else (1.0, 1.0)
    return 7.0, 7.0 * float(np.clip(height / width, 0.45, 1.2)) + 0.5


def _draw_map(axes: Axes, drawing: Drawing) -> None:
    scene, objects = drawing.landmarks, drawing.objects
    if scene is not None:
        draw_classes(axes, scene.classes, scene.positions_xy)
        draw_ellipses(axes, scene.positions_xy, scene.covariances)
        _draw_groups(axes, drawing.groups, dict(zip(scene.ids, scene.positions_xy, strict=True)))
    if objects is not None and len(objects):
        x, y = objects.positions_xy.T
        axes.scatter(x, y, s=70, facecolors="none", edgecolors=_TRUTH, linewidths=0.9, label="true object", zorder=3)


def _draw_groups(axes: Axes, groups: tuple[Group, ...], place: dict[str, Array]) -> None:
    """Landmarks seen together as faint areas, and the poses that saw them, as in the thesis's figure 5.2.

    Groups that share landmarks would be a tangle, and are not drawn.
    """
    members = [identity for group in groups for identity in group.landmark_ids]
    if not groups or len(set(members)) < len(members):
        return
    areas = [np.array([place[name] for name in group.landmark_ids if name in place]) for group in groups]
    seen = [area for area in areas if len(area) > 2]
    axes.add_collection(PolyCollection(seen, facecolors="#0F172A0D", edgecolors="none"))
    poses = np.array([group.map_from_base for group in groups])
    x, y = poses[:, 0], poses[:, 1]
    axes.plot(x, y, color=_TRUTH, linewidth=0.8, linestyle=(0, (4, 3)), zorder=2)
    axes.quiver(x, y, np.cos(poses[:, 2]), np.sin(poses[:, 2]), color=_GROUP, scale=45, width=0.0035, zorder=4)
    axes.plot(x, y, ".", color=_GROUP, markersize=4, label="robot at a group", zorder=4)


def draw_ellipses(axes: Axes, positions_xy: Array, covariances: Array) -> None:
    """The 95 % regions of positions (N, 2), where their covariances (N, 2, 2) are known."""
    known = covariances.any(axis=(1, 2))
    if not known.any():
        return
    radii, directions_rad = regions_95(covariances[known])
    ellipses = EllipseCollection(
        2 * radii[:, 0],
        2 * radii[:, 1],
        np.degrees(directions_rad),
        units="xy",
        offsets=positions_xy[known],
        offset_transform=axes.transData,
        facecolors="#64748B26",
        edgecolors="#64748B",
        linewidths=0.7,
        zorder=4,
    )
    axes.add_collection(ellipses)
    axes.scatter([], [], s=60, facecolors="#64748B26", edgecolors="#64748B", linewidths=0.7, label="95 % region")


def draw_classes(axes: Axes, classes: tuple[str, ...], positions_xy: Array) -> None:
    """Few classes get a colour and marker each, many a label beside each landmark."""
    names = [name for name, _ in sorted(Counter(classes).items(), key=lambda item: (-item[1], item[0]))]
    if len(names) > len(_PALETTE):
        x, y = positions_xy.T
        axes.scatter(x, y, s=22, color=_PALETTE[0], edgecolors="white", label="landmark", zorder=6)
        _label(axes, [name.removeprefix("landmark_") for name in classes], positions_xy)
        return
    for name, colour, marker in zip(names, _PALETTE, _MARKERS, strict=False):
        mine = np.array([found == name for found in classes])
        axes.scatter(
            positions_xy[mine, 0],
            positions_xy[mine, 1],
            s=30,
            color=colour,
            marker=marker,
            edgecolors="white",
            linewidths=0.5,
            label=name,
            zorder=6,
        )


def _label(axes: Axes, texts: list[str], positions_xy: Array) -> None:
    """A text beside each position, on the side away from its neighbours; none if they are too many to read."""
    if len(texts) > _MOST_LABELS:
        return
    away = positions_xy[:, None] - positions_xy
    pull = away / np.maximum(np.sum(away**2, axis=-1, keepdims=True), 1e-6)
    direction = pull.sum(axis=1)
    offsets = 9 * direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-6)
    for text, (x, y), (right, up) in zip(texts, positions_xy.tolist(), offsets.tolist(), strict=True):
        axes.annotate(
            text,
            (x, y),
            (right, up),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7,
            color="#374151",
            zorder=6,
        )


def _draw_truth(axes: Axes, run: Run) -> None:
    path = np.zeros((0, 2)) if run.truth is None else breaks(run.truth)
    if len(path):
        axes.plot(*path.T, color=_TRUTH, linewidth=0.7, alpha=0.55, label="true path", zorder=1)


def _draw_estimate(axes: Axes, run: Run, colour: str, *, named: bool) -> None:
    if not len(run.estimate):
        return
    name = f"{run.name}: " if named else ""
    _draw_way(axes, run, colour)
    if run.continuous:
        path, label = breaks(run.estimate), f"{name}estimated path"
        starts = [0, *(np.flatnonzero(np.isnan(path[:, 0])) + 1).tolist()] if len(path) else []
        axes.plot(*path.T, ".-", color=colour, linewidth=0.9, markersize=3.5, markevery=starts, label=label, zorder=5)
        return
    found, truth = run.scored.estimate[:, :2], run.scored.reference[:, :2]
    axes.add_collection(LineCollection(list(np.stack([truth, found], axis=1)), colors=_ERROR, linewidths=0.9, zorder=4))
    axes.plot(*run.estimate.poses[:, :2].T, ".", color=colour, markersize=3.5, label=f"{name}position", zorder=5)
    if len(found):
        axes.plot([], [], color=_ERROR, linewidth=0.9, label="its error")
    far = found[np.hypot(*(found - truth).T) > FALSE_M]
    if len(far):
        axes.plot(
            *far.T,
            "o",
            markerfacecolor="none",
            markeredgecolor=_ERROR,
            markersize=8,
            label=f"{name}over {FALSE_M:g} m off",
            zorder=7,
        )


def _draw_way(axes: Axes, run: Run, colour: str) -> None:
    """Where a run starts, ends and heads; positions that do not follow one another have neither start nor end."""
    poses = waypoints(run.estimate, _ARROWS)
    if len(poses):
        x, y, heading = poses.T
        axes.quiver(
            x,
            y,
            np.cos(heading),
            np.sin(heading),
            color=colour,
            edgecolor="white",
            linewidth=0.6,
            pivot="mid",
            headwidth=4.0,
            units="inches",
            scale=7.0,
            width=0.022,
            zorder=6,
        )
        axes.plot([], [], marker="$\\rightarrow$", color=colour, markersize=11, linestyle="", label="heading")
    if follows(run.estimate):  # the ring of the start goes around the end of a closed loop
        axes.plot(
            *run.estimate.poses[0, :2],
            "o",
            markerfacecolor="none",
            markeredgecolor=colour,
            markeredgewidth=1.4,
            markersize=10,
            label="start",
            zorder=8,
        )
        axes.plot(*run.estimate.poses[-1, :2], "s", color=colour, markersize=5, label="end", zorder=8)
