"""Single images to look at: picture files, and the first one of the demo's log."""

import cv2
import numpy as np

from mcap_landmarks.channels import CAMERA_IMAGE
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.vision.pixels import Rgb, rgb_from_message

DEMO = "the demo's first image"
"""What the picture is called that is looked at where no file is given."""


def demo_picture() -> Rgb:
    """An image of the generator's with seven objects of three classes: the first one of the demo's log."""
    log = resource("recordings", "demo_map.mcap")
    with open_recording(log) as recording:
        first = next(recording.messages(recording.connections(CAMERA_IMAGE.topic)))
        return rgb_from_message(decode(CompressedImage, first.data))


def read_picture(path: Location) -> Rgb:
    """A picture file as OpenCV reads it (JPEG, PNG and others), in the way up that it is meant to be.

    Raises:
        UsageError: it cannot be read, or is no picture.
    """
    try:
        content = np.frombuffer(to_read(path).read_bytes(), np.uint8)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror}); check the path of the picture") from error
    bgr = cv2.imdecode(content, cv2.IMREAD_COLOR) if len(content) else None
    if bgr is None:
        raise UsageError(f"{path}: not a picture that can be read; give a JPEG or PNG file")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
