"""Scene objects as markers for RViz and Foxglove."""

import numpy as np

from mcap_landmarks.maps.map_markers import class_color
from mcap_landmarks.messages.annotations import Color
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape
from mcap_landmarks.messages.scene import SceneObjects

_HEIGHT_M, _SMALLEST_M, _LETTERS_M = 0.5, 0.1, 0.25
"""What can be seen in a view of some 10 m."""
_CUBOID_LETTERS_M, _SEEN_THROUGH = 0.6, 0.6
"""The same of objects of a cloud, which are seen from farther away, and with the points on them."""


def markers_from_scene(scene: SceneObjects) -> MarkerArray:
    """A body and a label with class and probability per object, in place of those of the scene before.

    Bodies are cylinders, of the objects of a cloud cuboids that lie as these do and are as high.
    """
    markers = []
    for i, options in enumerate(scene.hypotheses):
        name, probability = options[0]
        color, text = class_color(name), f"{name} {100 * probability:.0f} %"
        body = _cylinder(scene, i, color) if scene.boxes is None else _cuboid(scene.boxes, i, color)
        letters_m = _LETTERS_M if scene.boxes is None else _CUBOID_LETTERS_M
        above = body.position_m + np.array([0.0, 0.0, body.size_m[2] / 2 + letters_m])
        size = np.array([0.0, 0.0, letters_m])
        markers += [body, Marker("names", i, MarkerShape.TEXT_VIEW_FACING, above, size, color, text)]
    return MarkerArray(scene.stamp_ns, scene.frame_id, tuple(markers), replaces=True)


def _cylinder(scene: SceneObjects, i: int, color: Color) -> Marker:
    diameter = max(2 * float(scene.radii_m[i]), _SMALLEST_M)
    middle, size = np.append(scene.positions_xy[i], _HEIGHT_M / 2), np.array([diameter, diameter, _HEIGHT_M])
    return Marker("objects", i, MarkerShape.CYLINDER, middle, size, color)


def _cuboid(boxes: Boxes, i: int, color: Color) -> Marker:
    size, yaw_rad = np.maximum(boxes.sizes_m[i], _SMALLEST_M), float(boxes.yaws_rad[i])
    clear = (*color[:3], _SEEN_THROUGH)
    return Marker("objects", i, MarkerShape.CUBE, boxes.centres_m[i], size, clear, yaw_rad=yaw_rad)
