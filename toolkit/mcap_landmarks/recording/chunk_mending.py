"""Chunks whose header is damaged while their content is not: what the content's own CRC proves can be used."""

from collections.abc import Iterator

import zstandard

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content
from mcap_landmarks.recording.container import CHUNK

_NAMES = (b"zstd", b"lz4", b"")


def mended_head(record: bytes | memoryview) -> tuple[bytes, int, int] | None:
    """The header that a chunk should have, where its data begin in `record` and how long they are.

    `record` is what follows the opcode and length of the chunk. Every reading of its header is tried whose lengths
    agree; None if none gives a content with the CRC that the header names.
    """
    if len(record) < CHUNK.size + 12:
        return None
    start_ns, end_ns, size, crc = CHUNK.unpack_from(record)
    if not crc:
        return None
    for name, begin, length in _readings(record):
        data = record[begin : begin + length]
        for claimed in _sizes(name, data, size):
            head = CHUNK.pack(start_ns, end_ns, claimed, crc) + _prefixed(name) + length.to_bytes(8, "little")
            try:
                chunk_content(head + data, verify=True)
            except DamagedBlockError:
                continue
            return head, begin, length
    return None


def _prefixed(name: bytes) -> bytes:
    return len(name).to_bytes(4, "little") + name


def _readings(record: bytes | memoryview) -> Iterator[tuple[bytes, int, int]]:
    """Compression, start of the data and their length: as the header says, and up to the record's end."""
    stated = int.from_bytes(record[CHUNK.size : CHUNK.size + 4], "little")
    for width in dict.fromkeys((stated, 4, 3, 0)):
        begin = CHUNK.size + 4 + width + 8
        if width > 4 or begin > len(record):
            continue
        length = int.from_bytes(record[begin - 8 : begin], "little")
        given = bytes(record[CHUNK.size + 4 : begin - 8])
        for name in dict.fromkeys((given, *_NAMES)):
            for several in dict.fromkeys((length, len(record) - begin)):
                if name in _NAMES and several <= len(record) - begin:
                    yield name, begin, several


def _sizes(name: bytes, data: bytes | memoryview, stated: int) -> Iterator[int]:
    yield stated
    if name == b"":
        yield len(data)
    elif name == b"zstd":
        try:
            told = zstandard.frame_content_size(data)
        except zstandard.ZstdError:
            return
        if told > 0:
            yield told
