"""The header that messages begin with, read without decoding the rest."""

import struct
from typing import Literal

from mcap_landmarks.errors import MessageError

SHORTEST = 12
"""Bytes of the encapsulation and the stamp."""
_BIG, _LITTLE = struct.Struct(">iI"), struct.Struct("<iI")


def stamp_in(data: bytes | memoryview) -> int:
    """The stamp in nanoseconds of a message that begins with a header.

    Raises:
        MessageError: it is too short for one.
    """
    if len(data) < SHORTEST:
        raise MessageError("it is shorter than a header")
    seconds, rest = (_LITTLE if data[1] & 1 else _BIG).unpack_from(data, 4)
    return int(seconds) * 10**9 + int(rest)


def frame_in(data: bytes | memoryview) -> str:
    """The frame of a message that begins with a header."""
    size = int.from_bytes(data[12:16], "little" if data[1] & 1 else "big")
    return bytes(data[16 : 16 + max(size - 1, 0)]).decode(errors="replace")


def count_in(data: bytes | memoryview) -> int:
    """How many elements the sequence has that follows the header of a message, as in arrays of detections.

    Raises:
        MessageError: the message is too short for them.
    """
    order: Literal["little", "big"] = "little" if data[1:2] == b"\x01" else "big"
    start = (16 + int.from_bytes(data[12:16], order) + 3) & -4
    count = int.from_bytes(data[start : start + 4], order)
    if len(data) < start + 4 + count:  # every element takes a byte at least
        raise MessageError("it is shorter than its sequence")
    return count
