"""Scene objects as markers for RViz and Foxglove."""

import numpy as np

from mcap_landmarks.maps.map_markers import class_color
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape
from mcap_landmarks.messages.scene import SceneObjects

_HEIGHT_M, _SMALLEST_M, _LETTERS_M = 0.5, 0.1, 0.25
"""What can be seen in a view of some 10 m."""


def markers_from_scene(scene: SceneObjects) -> MarkerArray:
    """A cylinder and a label with class and probability per object, in place of those of the scene before."""
    markers = []
    for i, (options, position) in enumerate(zip(scene.hypotheses, scene.positions_xy, strict=True)):
        name, probability = options[0]
        color, diameter = class_color(name), max(2 * float(scene.radii_m[i]), _SMALLEST_M)
        body, label = np.append(position, _HEIGHT_M / 2), np.append(position, _HEIGHT_M + _LETTERS_M)
        size, letters = np.array([diameter, diameter, _HEIGHT_M]), np.array([0.0, 0.0, _LETTERS_M])
        text = f"{name} {100 * probability:.0f} %"
        markers += [
            Marker("objects", i, MarkerShape.CYLINDER, body, size, color),
            Marker("names", i, MarkerShape.TEXT_VIEW_FACING, label, letters, color, text),
        ]
    return MarkerArray(scene.stamp_ns, scene.frame_id, tuple(markers), replaces=True)
