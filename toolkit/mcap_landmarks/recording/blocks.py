"""Blocks of a recording to records: decompress, check, part."""

import io
import threading
from collections.abc import Iterator
from struct import error as struct_error
from typing import BinaryIO

import lz4.frame
import zstandard

from mcap_landmarks import memory
from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import CHUNK, LARGEST_CHUNK, RECORD, Opcode
from mcap_landmarks.recording.summary_index import Block

_OF_THREAD = threading.local()


class DamagedBlockError(ValueError):
    """A chunk that cannot be trusted; the message says why."""


def chunk_content(record: bytes | memoryview, *, verify: bool) -> memoryview:
    """The uncompressed records of a chunk, from the content of its record.

    Raises:
        DamagedBlockError: it cannot be decompressed, has another size than declared, or a wrong CRC.
    """
    size, crc, compression, data, length = _header(record)
    if len(data) != length:
        raise DamagedBlockError(f"it claims {size} bytes from {length}")
    content = _decompress(compression, data, size)
    if len(content) != size:
        raise DamagedBlockError(f"it holds {len(content)} bytes instead of {size}")
    if verify and crc and crc32(content) != crc:
        raise DamagedBlockError("its CRC does not match")
    return content


def cut_chunk_content(record: bytes | memoryview) -> memoryview:
    """What can be had of a chunk that the end of the file cuts: its first whole records. Their CRC is unknown.

    Raises:
        DamagedBlockError: not even its header is there, or the bytes are not what it says.
    """
    size, _, compression, data, _ = _header(record)
    content = data
    try:
        if compression == "zstd":
            stream = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data))
            content = memoryview(memory.read_within(stream, len(data), size))
        elif compression == "lz4":
            content = memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, size))
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise DamagedBlockError(f"{compression} cannot decompress it") from error
    except memory.TooLargeError as error:
        raise DamagedBlockError(str(error)) from error
    position = 0
    while position + RECORD.size <= len(content):
        end = position + RECORD.size + RECORD.unpack_from(content, position)[1]
        if end > len(content):
            break
        position = end
    return content[:position]


def _header(record: bytes | memoryview) -> tuple[int, int, str, memoryview, int]:
    """Uncompressed size, CRC, compression, the data that is there, and how long it should be."""
    try:
        _, _, size, crc = CHUNK.unpack_from(record)
        name_length = int.from_bytes(record[28:32], "little")
        compression = bytes(record[32 : 32 + name_length]).decode()
    except (struct_error, ValueError) as error:
        raise DamagedBlockError("its header is damaged") from error
    if size > LARGEST_CHUNK:
        raise DamagedBlockError(f"it claims {size} bytes")
    if compression and (problem := memory.excess(size, len(record))):
        raise DamagedBlockError(problem)
    start = 32 + name_length + 8
    length = int.from_bytes(record[start - 8 : start], "little")
    return size, crc, compression, memoryview(record)[start : start + length], length


def _decompress(compression: str, data: memoryview, size: int) -> memoryview:
    if compression == "":
        return data
    try:
        if compression == "zstd":
            if zstandard.frame_content_size(data) not in {-1, size}:
                raise DamagedBlockError("its sizes contradict each other")
            return memoryview(_decompressor().decompress(data, max_output_size=size))
        if compression == "lz4":
            stream = lz4.frame.LZ4FrameDecompressor()
            content = memoryview(stream.decompress(data, size))
            if not stream.eof and len(content) == size and stream.decompress(b"", 1):
                raise DamagedBlockError(f"it holds more than the {size} bytes that it claims")
            return content
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise DamagedBlockError(f"{compression} cannot decompress it") from error
    raise DamagedBlockError(f"its compression {compression!r} is unknown")


def _decompressor() -> zstandard.ZstdDecompressor:
    """The one of this thread: each serves one at a time, and takes a tenth as long to make as to unpack 1 MiB."""
    if (found := getattr(_OF_THREAD, "zstd", None)) is None:
        found = _OF_THREAD.zstd = zstandard.ZstdDecompressor()
    return found


def records_in(content: memoryview) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of the content of each record.

    Raises:
        DamagedBlockError: the last one runs over the end.
    """
    position, end = 0, len(content)
    unpack = RECORD.unpack_from
    while position < end:
        if position + RECORD.size > end:
            raise DamagedBlockError("a record in it is cut")
        opcode, length = unpack(content, position)
        start = position + RECORD.size
        position = start + length
        if position > end:
            raise DamagedBlockError("a record in it is longer than the chunk")
        yield opcode, start, position


def block_content(stream: BinaryIO, block: Block, *, verify: bool) -> memoryview:
    """The uncompressed records of a block, whose length is known to be one that the file has.

    Raises:
        DamagedBlockError: the block cannot be trusted.
    """
    stream.seek(block.offset)
    raw = stream.read(block.length)
    if len(raw) < block.length:
        raise DamagedBlockError("the file ends within it")
    if block.head:
        return chunk_content(block.head + raw, verify=verify)
    if block.is_chunk:
        if raw[0] != Opcode.CHUNK:
            raise DamagedBlockError("there is no chunk where the summary says")
        record = memoryview(raw)[RECORD.size :]
        return cut_chunk_content(record) if block.is_cut else chunk_content(record, verify=verify)
    return memoryview(raw)
