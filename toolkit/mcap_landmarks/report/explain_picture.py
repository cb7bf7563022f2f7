"""The picture of an explanation: image with boxes, scan with clusters and objects, map around the candidates."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mcap_landmarks.evaluation.explain import Place, Situation
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.report.explain_reading import Picture, SensorData

_GREY, _OBJECT, _CLUSTER, _BOX = "#9CA3AF", "#D55E00", "#0072B2", "#FACC15"
_PLACES = ("#111827", "#7E22CE", "#047857", "#B45309", "#1D4ED8")
_AROUND_M = 6.0
"""So far around the landmarks of the candidates the map is drawn: enough to show what stands beside them."""


def explanation_figure(situation: Situation, places: tuple[Place, ...], view: SensorData, title: str = "") -> Figure:
    """As many panels as there is something to show: at least the objects around the robot."""
    maps = situation.landmarks is not None and any(place.pose is not None for place in places)
    count = 1 + len(view.pictures) + maps
    result = Figure(figsize=(5.6 * count, 5.4), layout="constrained")
    panels = iter(result.subplots(1, count, squeeze=False)[0])
    for picture in view.pictures:
        _draw_image(next(panels), situation, picture, "image" if len(view.pictures) == 1 else "")
    _draw_objects(next(panels), situation, view)
    if maps:
        _draw_map(next(panels), situation, places)
    if title:
        result.suptitle(title, x=0.01, ha="left", color="#111827", fontsize=11, fontweight="bold")
    return result


def _draw_image(axes: Axes, situation: Situation, picture: Picture, name: str) -> None:
    """An image with its boxes; without a name it gets that of its camera's frame."""
    axes.imshow(picture.pixels)
    axes.set_axis_off()
    found = picture.detections
    if found is None:
        axes.set_title("image, without detections", loc="left", fontsize=9)
        return
    apart_ms = (found.stamp_ns - situation.stamp_ns) / 1e6
    axes.set_title(f"{name or found.frame_id}, {apart_ms:+.0f} ms beside the scan", loc="left", fontsize=9)
    for (x1, y1, x2, y2), options in zip(found.boxes_xyxy.tolist(), found.hypotheses, strict=True):
        axes.add_patch(Rectangle((x1, y1), x2 - x1, y2 - y1, fill=False, edgecolor=_BOX, linewidth=1.4))
        if options:
            text = f"{options[0][0]} {options[0][1]:.2f}"
            axes.annotate(text, (x1, y1), (0, 2), textcoords="offset points", fontsize=7, color=_BOX)


def _draw_objects(axes: Axes, situation: Situation, view: SensorData) -> None:
    """Points, clusters and objects in the base frame, x ahead."""
    if view.scan_xy is not None:
        axes.plot(*view.scan_xy.T, ".", color=_GREY, markersize=2.5, label="scan")
    if situation.scan_objects is not None and len(situation.scan_objects):
        middles = np.array([points[-1] for points in situation.scan_objects.positions_xy if len(points)])
        axes.plot(*middles.T, "s", markerfacecolor="none", markeredgecolor=_CLUSTER, markersize=9, label="cluster")
    scene = situation.scene
    if scene is not None and len(scene):
        axes.plot(*scene.positions_xy.T, "o", color=_OBJECT, markersize=5, label="object")
        for options, place in zip(scene.hypotheses, scene.positions_xy, strict=True):
            text = f"{options[0][0]} {options[0][1]:.2f}" if options else "?"
            axes.annotate(text, place, (5, 4), textcoords="offset points", fontsize=7, color="#374151")
    axes.plot(0, 0, marker=(3, 0, -90), color="#111827", markersize=10, linestyle="", label="robot")
    _finish(axes, "around the robot [m], x ahead")


def _draw_map(axes: Axes, situation: Situation, places: tuple[Place, ...]) -> None:
    """Landmarks near the candidates, each candidate's pose, and the objects as seen from the best one."""
    landmarks = situation.landmarks
    assert landmarks is not None  # noqa: S101 - the caller looked
    fitted = [(number, place) for number, place in enumerate(places, 1) if place.pose is not None]
    names = [name for _, place in fitted for name in place.landmark_ids if name in landmarks.ids]
    spots = np.vstack(
        [
            *[place.pose[None, :2] for _, place in fitted if place.pose is not None],
            landmarks.positions_xy[[landmarks.ids.index(name) for name in names]],
        ]
    )
    low, high = spots.min(axis=0) - _AROUND_M, spots.max(axis=0) + _AROUND_M
    near = ((landmarks.positions_xy >= low) & (landmarks.positions_xy <= high)).all(axis=1)
    axes.plot(*landmarks.positions_xy[near].T, "x", color=_GREY, markersize=6, label="landmark")
    for name, place in zip(np.array(landmarks.classes)[near].tolist(), landmarks.positions_xy[near], strict=True):
        axes.annotate(name, place, (4, -8), textcoords="offset points", fontsize=6, color=_GREY)
    for (number, place), colour in zip(fitted, _PLACES, strict=False):
        _draw_place(axes, situation, place, number, colour)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    _finish(axes, "map around the candidates [m]")


def _draw_place(axes: Axes, situation: Situation, place: Place, number: int, colour: str) -> None:
    pose: Array | None = place.pose
    if pose is None or situation.scene is None:
        return
    share = f", share {place.share:.2f}" if np.isfinite(place.share) else ""
    if not np.isfinite(pose[2]):
        axes.plot(*pose[:2], "*", color=colour, markersize=10, label=f"place {number}, heading unknown{share}")
        return
    axes.quiver(
        *pose[:2], np.cos(pose[2]), np.sin(pose[2]), color=colour, width=0.006, scale=18, label=f"place {number}{share}"
    )
    seen = transform_points(pose, situation.scene.positions_xy)
    axes.plot(*seen.T, "o", markerfacecolor="none", markeredgecolor=colour, markersize=8)
    for row in place.rows.tolist():
        axes.plot(*np.stack([pose[:2], seen[row]]).T, color=colour, linewidth=0.6, alpha=0.6)


def _finish(axes: Axes, title: str) -> None:
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(title, loc="left", fontsize=9)
    axes.grid(color="#E5E7EB", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=4, fontsize=7, frameon=False)
