"""Where a damaged ROS 1 bag goes on: the next place at which a record stands that can be trusted."""

import re
from typing import BinaryIO

from mcap_landmarks.sources import _bag_container as container
from mcap_landmarks.sources._bag_container import DamagedBagError

_OPERATION = re.compile(rb"\x04\x00\x00\x00op=[\x05-\x07]")
"""The field that says chunk, chunk info or connection; index records are of no use without the chunk before them."""
_WINDOW = 1 << 20
_BEFORE = 512
"""Bytes of a header before that field at most: the topic of a connection is the longest that can come there."""
_LARGEST_HEADER = 4096


def next_record(stream: BinaryIO, size: int, offset: int) -> int | None:
    """The first place from an offset on where a sound chunk begins, or a connection or chunk info; None for none."""
    budget = 8 * size  # each false chunk is read: a file of nothing but these shall not take forever
    for start in range(offset, size, _WINDOW):
        stream.seek(start)
        window = stream.read(_WINDOW + 8)
        for match in _OPERATION.finditer(window):
            for begin in _beginnings(stream, start + match.start(), offset):
                length = _record_bytes(stream, size, begin, budget)
                if length is not None:
                    return begin
                budget -= size // 64
                if budget < 0:
                    return None
    return None


def _beginnings(stream: BinaryIO, place: int, least: int) -> list[int]:
    """Where a record may begin whose header has a field at a place: what stands there is the header's length."""
    first = max(place - 4 - _BEFORE, least)
    stream.seek(first)
    before = stream.read(place - first + _LARGEST_HEADER)
    found = []
    for begin in range(place - 4 - first, -1, -1):
        length = int.from_bytes(before[begin : begin + 4], "little")
        if place - first - begin - 4 + 8 <= length <= _LARGEST_HEADER:
            try:
                header = container.parse_header(memoryview(before)[begin + 4 : begin + 4 + length])
            except DamagedBagError:
                continue
            if b"op" in header:
                found.append(first + begin)
    return found


def _record_bytes(stream: BinaryIO, size: int, begin: int, most: int) -> int | None:
    """The length of the data of a sound record, None if it is none: a chunk has to be whole, with all its records."""
    stream.seek(begin)
    try:
        header, length = container.read_header(stream, size)
        if length > min(size - stream.tell(), most):
            return None
        kind = container.operation(header)
        data = container.read_exactly(stream, length, size - stream.tell())
        if kind == container.CHUNK:
            content, is_whole = container.decompress(header, data)
            return length if is_whole and container.parse_chunk(content)[2] is None else None
        if kind == container.CONNECTION:
            container.parse_connection(header, memoryview(data))
        else:
            container.parse_chunk_info(header, data)
    except DamagedBagError:
        return None
    return length
