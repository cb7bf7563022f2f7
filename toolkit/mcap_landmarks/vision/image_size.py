"""How large an image is, without looking at its pixels where that can be avoided."""

import struct

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.vision.pixels import rgb_from_message

_JPEG, _PNG = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"
_FRAME_STARTS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""The markers of a JPEG that are followed by its size (ITU-T T.81, table B.1)."""
_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""Those that are followed by nothing."""


def image_size(message: Image | CompressedImage) -> tuple[int, int] | None:
    """Width and height in pixels; None where the message is no picture."""
    if isinstance(message, Image):
        return (message.width_px, message.height_px) if message.width_px and message.height_px else None
    try:
        return _in_header(message.data) or _decoded(message)
    except MessageError:
        return None


def _decoded(message: CompressedImage) -> tuple[int, int]:
    height, width = rgb_from_message(message).shape[:2]
    return width, height


def _in_header(data: bytes) -> tuple[int, int] | None:
    """What a PNG or JPEG says of its size at its start; None of other kinds, and where it is cut short before that."""
    if data.startswith(_PNG) and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return width, height
    at = 2 if data.startswith(_JPEG) else len(data)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _FRAME_STARTS:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        if marker in _ALONE or marker == 0xFF:
            at += 2 if marker in _ALONE else 1
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
