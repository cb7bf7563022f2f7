"""A landmark map as markers for RViz and Foxglove."""

import colorsys
import zlib

import numpy as np

from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.annotations import Color
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape

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
            Marker("landmarks", int(i), MarkerShape.CYLINDER, body, np.array([diameter, diameter, _HEIGHT_M]), color),
            Marker("names", int(i), MarkerShape.TEXT_VIEW_FACING, label, np.array([0.0, 0.0, _LETTERS_M]), color, name),
        ]
    return MarkerArray(stamp_ns, landmark_map.frame, tuple(markers))
