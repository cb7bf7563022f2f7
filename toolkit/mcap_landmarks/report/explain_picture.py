"""The picture of an explanation: image with boxes, scan with clusters and objects, map around the candidates."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from mcap_landmarks.evaluation.explain import Place, Situation
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.cloud_picture import draw_cuboids, draw_from_above, draw_lost, draw_velocities
from mcap_landmarks.report.explain_reading import Picture, SensorData
from mcap_landmarks.report.explain_words import beside_the_scan
from mcap_landmarks.report.plots import draw_ellipses

_GREY, _OBJECT, _CLUSTER, _BOX = "#9CA3AF", "#D55E00", "#0072B2", "#FACC15"
_PLACES = ("#111827", "#7E22CE", "#047857", "#B45309", "#1D4ED8")
_WIDE_IN = 12.0
"""Width of a picture with images above a cloud, in inches: names of 7 points can be read on a screen."""
_BELOW_IN = 5.9
_IMAGE_OF_CLOUD = "detections (yellow), objects (coloured boxes), detections that are no object (red, dashed)"
_AROUND_M = 6.0
"""So far around the landmarks of the candidates the map is drawn: enough to show what stands beside them."""


def explanation_figure(situation: Situation, places: tuple[Place, ...], view: SensorData, title: str = "") -> Figure:
    """As many panels as there is something to show: at least the objects around the robot.

    Those of a planar scan are in a row; a cloud is below the images of all cameras, which are as wide as all.
    """
    maps = situation.landmarks is not None and any(place.pose is not None for place in places)
    images = [picture for picture in view.pictures if picture.pixels is not None]
    if view.cloud is not None and images:
        result, above, below = _image_grid(images, 1 + maps)
    else:
        count = len(images) + 1 + maps
        result = Figure(figsize=(5.6 * count, 5.4), layout="constrained")
        panels = result.subplots(1, count, squeeze=False)[0].tolist()
        above, below = panels[: len(images)], panels[len(images) :]
    for axes, picture in zip(above, images, strict=False):
        _draw_image(axes, situation, picture, "image" if len(images) == 1 else "")
    _draw_objects(below[0], situation, view)
    if maps:
        _draw_map(below[1], situation, places)
    if title:
        result.suptitle(title, x=0.01, ha="left", color="#111827", fontsize=11, fontweight="bold")
    return result


def _image_grid(images: Sequence[Picture], count: int) -> tuple[Figure, list[Axes], list[Axes]]:
    """A figure with a grid of images above, and so many panels in a row below it."""
    columns = math.ceil(math.sqrt(len(images)))
    rows = math.ceil(len(images) / columns)
    ratio = max(picture.pixels.shape[0] / picture.pixels.shape[1] for picture in images if picture.pixels is not None)
    tall = rows * float(np.clip(_WIDE_IN / columns * ratio, 2.5, 8.0)) + 0.5
    result = Figure(figsize=(_WIDE_IN, tall + _BELOW_IN), layout="constrained")
    above, below = result.subfigures(2, 1, squeeze=False, height_ratios=(tall, _BELOW_IN)).ravel()
    above.suptitle(_IMAGE_OF_CLOUD, x=0.01, ha="left", fontsize=9)
    panels = above.subplots(rows, columns, squeeze=False).ravel().tolist()
    for axes in panels[len(images) :]:
        axes.set_axis_off()
    return result, panels, below.subplots(1, count, squeeze=False)[0].tolist()


def _draw_image(axes: Axes, situation: Situation, picture: Picture, name: str) -> None:
    """An image with its boxes; without a name it gets that of its camera's frame."""
    if picture.pixels is None:
        return
    axes.imshow(picture.pixels)
    axes.set_axis_off()
    found = picture.detections
    if found is None:
        axes.set_title("image, without detections", loc="left", fontsize=9)
        return
    when = beside_the_scan(found.stamp_ns, situation.stamp_ns)
    axes.set_title(f"{name or found.frame_id}, {when}", loc="left", fontsize=9)
    for (x1, y1, x2, y2), options in zip(found.boxes_xyxy.tolist(), found.hypotheses, strict=True):
        axes.add_patch(Rectangle((x1, y1), x2 - x1, y2 - y1, fill=False, edgecolor=_BOX, linewidth=1.4))
        if options:
            text = f"{options[0][0]} {options[0][1]:.2f}"
            axes.annotate(
                text,
                (x1, y1),
                (0, 2),
                textcoords="offset points",
                fontsize=7,
                color=_BOX,
                path_effects=[withStroke(linewidth=1.5, foreground="#111827")],
            )
    if situation.scene is not None and situation.scene.boxes is not None and picture.view is not None:
        draw_lost(axes, picture.lost or ())
        draw_cuboids(axes, situation.scene, situation.scene.boxes, picture.view)
        axes.set_xlim(0, picture.pixels.shape[1])
        axes.set_ylim(picture.pixels.shape[0], 0)


def _draw_objects(axes: Axes, situation: Situation, view: SensorData) -> None:
    """Points, clusters and objects in the base frame, x ahead."""
    scene = situation.scene
    if scene is not None and view.cloud is not None:
        _draw_cloud(axes, scene, view, view.cloud)
        return
    if view.scan_xy is not None:
        axes.plot(*view.scan_xy.T, ".", color=_GREY, markersize=2.5, label="scan")
    if situation.scan_objects is not None and len(situation.scan_objects):
        middles = np.array([points[-1] for points in situation.scan_objects.positions_xy if len(points)])
        axes.plot(*middles.T, "s", markerfacecolor="none", markeredgecolor=_CLUSTER, markersize=9, label="cluster")
    if scene is not None and len(scene):
        draw_ellipses(axes, scene.positions_xy, scene.covariances)
        axes.plot(*scene.positions_xy.T, "o", color=_OBJECT, markersize=5, label="object")
        for options, place in zip(scene.hypotheses, scene.positions_xy, strict=True):
            text = f"{options[0][0]} {options[0][1]:.2f}" if options else "?"
            axes.annotate(text, place, (5, 4), textcoords="offset points", fontsize=7, color="#374151")
    _draw_robot(axes)
    _finish(axes, "around the robot [m], x ahead")


def _draw_cloud(axes: Axes, scene: SceneObjects, view: SensorData, cloud: ClusteredCloud) -> None:
    draw_from_above(axes, scene, cloud, view.views)
    if view.velocities is not None:
        draw_velocities(axes, scene, view.velocities)
    _draw_robot(axes)
    _finish(axes, "from above [m], ahead is to the right; points above the ground, a colour per cluster")


def _draw_robot(axes: Axes) -> None:
    axes.plot(0, 0, marker=(3, 0, -90), color="#111827", markersize=10, linestyle="", label="robot", zorder=6)


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
