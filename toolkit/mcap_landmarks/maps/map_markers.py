"""A landmark map as markers for RViz and Foxglove, and what of it they still tell."""

import colorsys
import zlib

import numpy as np

from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.annotations import Color
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape
from mcap_landmarks.messages.scene import SceneObjects

_BODIES, _LABELS = "landmarks", "names"
"""The namespaces of the cylinders and of their labels, which share a number."""
_HEIGHT_M, _SMALLEST_M, _LETTERS_M = 0.6, 0.1, 0.35
"""Height and least diameter of a cylinder, and size of its label: to be seen from the height of a whole map."""


def class_color(name: str) -> Color:
    """A colour that a class always has, whatever else is drawn."""
    hue = zlib.crc32(name.encode()) / 2**32
    return (*colorsys.hsv_to_rgb(hue, 0.65, 0.85), 1.0)


def markers_from_map(landmark_map: LandmarkMap, stamp_ns: int) -> MarkerArray:
    """A cylinder and a label per confirmed landmark."""
    markers = []
    for i in np.flatnonzero(~landmark_map.tentative):
        x, y = landmark_map.positions_xy[i].tolist()
        name, color = landmark_map.classes[i], class_color(landmark_map.classes[i])
        diameter = max(2 * float(landmark_map.radii_m[i]), _SMALLEST_M)
        body = np.array([x, y, _HEIGHT_M / 2])
        label = np.array([x, y, _HEIGHT_M + _LETTERS_M])
        markers += [
            Marker(_BODIES, int(i), MarkerShape.CYLINDER, body, np.array([diameter, diameter, _HEIGHT_M]), color),
            Marker(_LABELS, int(i), MarkerShape.TEXT_VIEW_FACING, label, np.array([0.0, 0.0, _LETTERS_M]), color, name),
        ]
    return MarkerArray(stamp_ns, landmark_map.frame, tuple(markers))


def landmarks_from_markers(markers: MarkerArray) -> SceneObjects:
    """The landmarks that markers of ours show: class, position and diameter; the covariances are unknown."""
    names = {marker.number: marker.text for marker in markers.markers if marker.name == _LABELS}
    bodies = [marker for marker in markers.markers if marker.name == _BODIES and marker.number in names]
    return SceneObjects(
        markers.stamp_ns,
        markers.frame_id,
        tuple(str(marker.number) for marker in bodies),
        tuple(((names[marker.number], 1.0),) for marker in bodies),
        np.array([marker.position_m[:2] for marker in bodies]).reshape(-1, 2),
        np.zeros((len(bodies), 2, 2)),
        np.array([marker.size_m[0] / 2 for marker in bodies]),
    )
