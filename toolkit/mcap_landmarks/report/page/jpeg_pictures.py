"""Images of a page: scaled and compressed until they fit the room that they get."""

import base64

import cv2

from mcap_landmarks.vision.pixels import Rgb

_STEPS = ((640, 80), (480, 75), (400, 65), (320, 55), (240, 45))
"""Widths in pixels and JPEG qualities that are tried: at the last one boxes of 5 % of the width can still be told."""


def data_url(rgb: Rgb, most_bytes: int, first: int = 0) -> tuple[str, int]:
    """A picture as a `data:` URL of a JPEG of at most so many bytes, or as small as it gets, and the step that fitted.

    Steps before the `first` are not tried: what did not fit the picture before will hardly fit this one.
    """
    data, step = b"", first
    for step in range(first, len(_STEPS)):
        width_px, quality = _STEPS[step]
        scale = width_px / rgb.shape[1]
        if scale < 1:
            size = width_px, max(1, round(rgb.shape[0] * scale))
            small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
        else:
            small = rgb
        bgr = cv2.cvtColor(small, cv2.COLOR_RGB2BGR)
        data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= most_bytes:
            break
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode()}", step
