"""The header that messages begin with, read without decoding the rest."""

import struct

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
