"""Whether a summary tells the truth about where everything lies: it is held against the heads of the records."""

from collections.abc import Collection, Sequence
from typing import BinaryIO

from mcap import records

from mcap_landmarks.recording.container import CHUNK, RECORD, Opcode, read_up_to
from mcap_landmarks.recording.reading_ahead import gather_indexed
from mcap_landmarks.recording.record_shapes import ReadAt, fits, head_at

_BETWEEN = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.DATA_END}


class DistrustedIndexError(ValueError):
    """The summary and the records contradict each other; the message says where."""


def check_index(
    stream: BinaryIO,
    data: tuple[int, int],
    chunks: Sequence[records.ChunkIndex],
    places: Collection[int],
    *,
    is_covered: bool,
) -> int:
    """Walk the data section, from one offset to another, along what the summary names; chunks that have no CRC.

    `chunks` come in the order of the file, `places` are those of attachments and metadata. Nothing else may lie
    between. Where no CRC covers the summary (`is_covered`), the channels of each chunk are looked up, too.

    Raises:
        DistrustedIndexError: as the class says.
    """

    def read(offset: int, size: int) -> bytes:
        stream.seek(offset)
        return read_up_to(stream, size)

    gather_indexed(stream, chunks, with_indexes=not is_covered)
    offset, end = data
    unverified = 0
    found: set[int] = set()
    for chunk in chunks:
        start = chunk.chunk_start_offset
        _walk(read, offset, start, found)
        unverified += _crc(read, chunk) == 0
        if not is_covered:
            _check_channels(read, chunk)
        offset = start + chunk.chunk_length + chunk.message_index_length
    _walk(read, offset, end, found)
    if found != set(places):
        raise DistrustedIndexError("it does not name every attachment and metadata record")
    return unverified


def _walk(read: ReadAt, offset: int, end: int, found: set[int]) -> None:
    """From record to record up to where the next thing lies; attachments and metadata are `found`."""
    while offset < end:
        opcode, length = head_at(read, offset)
        if not (opcode in _BETWEEN and fits(opcode, length, read, offset + RECORD.size)) and opcode < 0x80:
            raise DistrustedIndexError(f"at byte {offset} lies what it does not name")
        if opcode in {Opcode.ATTACHMENT, Opcode.METADATA}:
            found.add(offset)
        offset += RECORD.size + length
    if offset != end:
        raise DistrustedIndexError(f"it names byte {end}, where no record begins")


def _crc(read: ReadAt, chunk: records.ChunkIndex) -> int:
    """The CRC in a chunk's header, which has to be as the index says."""
    name = chunk.compression.encode()
    tail = len(name).to_bytes(4, "little") + name + chunk.compressed_size.to_bytes(8, "little")
    times = chunk.message_start_time, chunk.message_end_time
    crc_at = RECORD.size + CHUNK.size - 4
    head = read(chunk.chunk_start_offset, crc_at + 4 + len(tail))
    crc = int.from_bytes(head[crc_at : crc_at + 4], "little")
    fixed = CHUNK.pack(*times, chunk.uncompressed_size, crc)
    if head != RECORD.pack(Opcode.CHUNK, chunk.chunk_length - RECORD.size) + fixed + tail:
        raise DistrustedIndexError(f"the chunk at byte {chunk.chunk_start_offset} is another than it says")
    return crc


def _check_channels(read: ReadAt, chunk: records.ChunkIndex) -> None:
    for channel_id, offset in chunk.message_index_offsets.items():
        opcode, _ = head_at(read, offset)
        if opcode != Opcode.MESSAGE_INDEX or int.from_bytes(read(offset + RECORD.size, 2), "little") != channel_id:
            raise DistrustedIndexError(f"the channels of the chunk at byte {chunk.chunk_start_offset} are others")
