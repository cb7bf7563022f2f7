"""A cloud and its objects in a picture: clusters in colours from above, objects as boxes there and in the image."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import hsv_to_rgb
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray

from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.report.box_outcomes import LostBox, corners_of, edges_in_image
from mcap_landmarks.report.plots import draw_ellipses

_OBJECTS = ("#D55E00", "#0072B2", "#009E73", "#B0127B", "#7A5195", "#A16207", "#0E7490", "#BE123C")
_LOST, _RANGE, _MOVES = "#EF4444", "#9CA3AF", "#111827"
_DASHES = (0, (6, 3))
_GOLDEN = 0.618034
"""Hues so far apart of one another never come close to each other (Knuth, TAOCP 3, 6.4, multiplicative hashing)."""
_AROUND_M, _LEAST_M = 4.0, 20.0
"""How much is drawn around the objects, and of what length where there are none or only near ones."""
_FAR_M = 500.0
"""So far the edges of the image are drawn: beyond all that LiDARs see."""
_FLATTEST = 0.42
"""Height of the view over its length, at least: room for the names of what stands in a row."""


def object_colour(i: int) -> str:
    """The colour of an object of a scene, in the image and from above."""
    return _OBJECTS[i % len(_OBJECTS)]


def draw_cuboids(axes: Axes, scene: SceneObjects, boxes: Boxes, view: CameraView) -> None:
    """Objects as boxes in an image, named as they are from above."""
    for i in range(len(scene)):
        lines = edges_in_image(view, boxes, i)
        axes.add_collection(LineCollection(list(lines), colors=object_colour(i), linewidths=1.1))
        flat = lines.reshape(-1, 2)
        inside = flat[
            np.isfinite(flat).all(axis=1) & (flat >= 0).all(axis=1) & (flat <= view.camera.size_px).all(axis=1)
        ]
        if len(inside):
            _name(
                axes, scene.ids[i] or str(i + 1), (inside[:, 0].mean(), inside[:, 1].max()), object_colour(i), "center"
            )


def draw_lost(axes: Axes, lost: Sequence[LostBox]) -> None:
    """Boxes that are no object."""
    for one in lost:
        x1, y1, x2, y2 = one.box_xyxy.tolist()
        axes.add_patch(
            Rectangle((x1, y1), x2 - x1, y2 - y1, fill=False, edgecolor=_LOST, linewidth=1.2, linestyle=(0, (3, 2)))
        )


def draw_from_above(axes: Axes, scene: SceneObjects, cloud: ClusteredCloud, views: Sequence[CameraView]) -> None:
    """Clusters, objects with their 95 % regions, and what images show, in the base frame; ahead is to the right."""
    corners = [] if scene.boxes is None else [corners_of(scene.boxes, i)[[0, 2, 6, 4], :2] for i in range(len(scene))]
    low, high = _limits(corners)
    points = cloud.points_m[:, :2]
    near = ((points >= low) & (points <= high)).all(axis=1)
    x, y = points[near].T
    axes.scatter(x, y, s=1.2, c=_colours(cloud.clusters[near]), linewidths=0, rasterized=True, zorder=2)
    draw_ellipses(axes, scene.positions_xy, scene.covariances)
    for i, (options, sides) in enumerate(zip(scene.hypotheses, corners, strict=False)):
        axes.add_patch(Polygon(sides, fill=False, edgecolor=object_colour(i), linewidth=1.6, zorder=5))
        name, score = options[0] if options else ("?", 0.0)
        text = f"{scene.ids[i] or i + 1}  {name} {score:.2f}"
        _name(axes, text, (sides[:, 0].mean(), sides[:, 1].max()), object_colour(i))
    if views:
        label = "edge of the image" if len(views) == 1 else "edge of an image"
        axes.plot([], [], color=_RANGE, linewidth=0.9, linestyle=_DASHES, label=label)
    for view in views:
        _draw_view(axes, view)
    for distance in range(10, int(np.hypot(*np.maximum(np.abs(low), np.abs(high)))), 10):
        angle = np.linspace(-np.pi, np.pi, 180)
        axes.plot(distance * np.cos(angle), distance * np.sin(angle), color=_RANGE, linewidth=0.4, zorder=1)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def draw_velocities(axes: Axes, scene: SceneObjects, velocities: SceneVelocities) -> None:
    """What rather moves than stands, with an arrow to where it is a second later."""
    moving = [i for i, name in enumerate(velocities.ids) if name in velocities.moving_ids and name in scene.ids]
    if not moving or velocities.frame_id != scene.frame_id:
        return
    x, y = scene.positions_xy[[scene.ids.index(velocities.ids[i]) for i in moving]].T
    u, v = velocities.velocities_mps[moving].T
    axes.quiver(x, y, u, v, angles="xy", scale_units="xy", scale=1.0, width=0.003, color=_MOVES, zorder=7)
    axes.plot([], [], color=_MOVES, linewidth=2, label="moves, in a second")


def _draw_view(axes: Axes, view: CameraView) -> None:
    """How far to the left and to the right the image shows something."""
    width, height = view.camera.size_px
    rays = view.camera.rays([[0, height / 2], [width, height / 2]]) @ view.base_from_camera[:3, :3].T
    start = view.base_from_camera[:2, 3]
    for x, y in rays[:, :2].tolist():
        line = start + np.array([[0.0, 0.0], [x, y]]) * (_FAR_M / np.hypot(x, y))
        axes.plot(*line.T, color=_RANGE, linewidth=0.9, linestyle=_DASHES)


def _limits(corners: Sequence[Array]) -> tuple[Array, Array]:
    """The least and largest x and y (2,) that are drawn: where robot and objects are, not all that a LiDAR sees."""
    spots = np.vstack([np.zeros((1, 2)), *corners])
    low, high = spots.min(axis=0) - _AROUND_M, spots.max(axis=0) + _AROUND_M
    high[0] = max(high[0], low[0] + _LEAST_M)
    short = _FLATTEST * (high[0] - low[0]) - (high[1] - low[1])
    if short > 0:
        low[1], high[1] = low[1] - short / 2, high[1] + short / 2
    return low, high


def _colours(clusters: NDArray[np.int32]) -> Array:
    """A colour (3,) for each of some points by its cluster (N,): light enough to leave the objects in front."""
    hue = (clusters * _GOLDEN) % 1.0
    colours: Array = hsv_to_rgb(np.stack([hue, np.full(len(hue), 0.55), np.full(len(hue), 0.80)], axis=1))
    return colours


def _name(axes: Axes, text: str, place: tuple[float, float], colour: str, side: str = "bottom") -> None:
    axes.annotate(
        text,
        place,
        (0, 2 if side == "bottom" else 0),
        textcoords="offset points",
        ha="center",
        va=side,
        fontsize=7,
        color="white",
        bbox={"boxstyle": "round,pad=0.15", "facecolor": colour, "edgecolor": "none", "alpha": 0.85},
        zorder=8,
        annotation_clip=True,
    )
