"""Pictures with the boxes of detections drawn into them, below each other or side by side."""

from collections.abc import Sequence

import cv2
import numpy as np

from mcap_landmarks.atomic import atomic_file, check_target
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.annotations import Color
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.vision.annotations import annotations
from mcap_landmarks.vision.pixels import Rgb

_FORMATS = (".png", ".jpg", ".jpeg")
_TEXT_PX, _USUAL_PX = 22, 800
"""The height of OpenCV's font at scale 1, and up to which side of an image a label keeps the size that it has."""


def with_boxes(rgb: Rgb, detections: Detections) -> Rgb:
    """A copy of an image with a box and a label for every detection, in the colours that `detect` gives classes."""
    image, drawn = rgb.copy(), annotations(detections)
    larger = max(1.0, max(rgb.shape) / _USUAL_PX)
    for outline in drawn.outlines:
        pixels = np.rint(outline.pixels_uv).astype(np.int32)
        cv2.polylines(image, [pixels], True, _grey_levels(outline.color), round(larger), cv2.LINE_AA)
    for label in drawn.labels:
        scale = larger * label.size_px / _TEXT_PX
        (width, height), below = cv2.getTextSize(label.text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
        left = int(min(label.pixel_uv[0], max(0, rgb.shape[1] - width)))
        bottom = int(max(label.pixel_uv[1], height + below))
        corners = (left, bottom - height - below), (left + width, bottom)
        cv2.rectangle(image, *corners, _grey_levels(label.background), -1)
        where = (left, bottom - below // 2)
        cv2.putText(
            image, label.text, where, cv2.FONT_HERSHEY_SIMPLEX, scale, _grey_levels(label.color), 1, cv2.LINE_AA
        )
    return image


def column(images: Sequence[Rgb]) -> Rgb:
    """Images below each other, on white."""
    width = max(image.shape[1] for image in images)
    rows = [np.pad(one, ((0, 0), (0, width - one.shape[1]), (0, 0)), constant_values=255) for one in images]
    return np.vstack(rows)


def check_picture(path: Location) -> None:
    """Refuse a file that no picture can be written to.

    Raises:
        UsageError: its name does not tell a format, or it cannot become a file.
    """
    check_target(path)
    if path.suffix.lower() not in _FORMATS:
        raise UsageError(f"{path}: the name does not tell the format; use {', '.join(_FORMATS)}")


def write_picture(path: Location, rgb: Rgb) -> None:
    """Write an image as the file's name says.

    Raises:
        UsageError: see `check_picture`.
        RecordingError: the disk is full, or the folder may not be written.
    """
    check_picture(path)
    _, data = cv2.imencode(path.suffix.lower(), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    with atomic_file(path) as stream:
        stream.write(data.tobytes())


def _grey_levels(colour: Color) -> tuple[int, int, int]:
    red, green, blue = (round(255 * share) for share in colour[:3])
    return red, green, blue
