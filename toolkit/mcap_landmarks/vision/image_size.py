"""How large an image is, without looking at its pixels where that can be avoided."""

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.vision.image_header import size_in_header
from mcap_landmarks.vision.pixels import rgb_from_message


def image_size(message: Image | CompressedImage) -> tuple[int, int] | None:
    """Width and height in pixels; None where the message is no picture."""
    if isinstance(message, Image):
        return (message.width_px, message.height_px) if message.width_px and message.height_px else None
    try:
        return size_in_header(message.data) or _decoded(message)
    except MessageError:
        return None


def _decoded(message: CompressedImage) -> tuple[int, int]:
    height, width = rgb_from_message(message).shape[:2]
    return width, height
