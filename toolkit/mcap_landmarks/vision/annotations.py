"""Detections as outlines and labels that Foxglove draws over the image."""

import colorsys
import zlib

import numpy as np

from mcap_landmarks.messages.annotations import Color, ImageAnnotations, Label, Outline
from mcap_landmarks.messages.detections import Detections

_THICKNESS_PX, _TEXT_PX = 2.0, 12.0
_BLACK: Color = (0.0, 0.0, 0.0, 1.0)


def annotations(detections: Detections) -> ImageAnnotations:
    """A box and a label for every detection, in a colour of its class."""
    outlines, labels = [], []
    for (left, top, right, bottom), hypotheses in zip(
        detections.boxes_xyxy.tolist(), detections.hypotheses, strict=True
    ):
        name, score = hypotheses[0]
        colour = _colour(name)
        corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        outlines.append(Outline(corners, colour, _THICKNESS_PX))
        labels.append(Label((left, top), f"{name} {score:.2f}", _TEXT_PX, _BLACK, colour))
    return ImageAnnotations(detections.stamp_ns, tuple(outlines), tuple(labels))


def _colour(name: str) -> Color:
    """A bright colour that a class has in every log, whatever the model."""
    red, green, blue = colorsys.hsv_to_rgb(zlib.crc32(name.encode()) % 360 / 360, 0.7, 1.0)
    return red, green, blue, 1.0
