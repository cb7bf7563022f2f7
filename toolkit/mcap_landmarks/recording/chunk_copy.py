"""Chunks that go from one recording into another as they are: only those whose every record would be the same there."""

from collections.abc import Mapping
from dataclasses import dataclass
from struct import error as struct_error
from typing import BinaryIO

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content, records_in
from mcap_landmarks.recording.container import CHUNK, RECORD, Opcode, parse, read_up_to
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.message_index import INDEX_HEAD, count_of, indexed
from mcap_landmarks.recording.summary_index import Block


@dataclass(frozen=True, slots=True)
class WholeChunk:
    """The whole record of a chunk, and of its message indexes by channel. `log_time_ns` is its first message's.

    `checked_crc` is that of its data, where these are not compressed and were held against it.
    """

    log_time_ns: int
    end_ns: int
    record: bytes
    indexes: Mapping[int, bytes]
    counts: Mapping[int, int]
    checked_crc: int | None = None


def compressed(record: bytes) -> tuple[str, memoryview]:
    """The compression of a whole chunk record, and the data that it has compressed."""
    start = RECORD.size + CHUNK.size
    name_end = start + 4 + int.from_bytes(record[start : start + 4], "little")
    return record[start + 4 : name_end].decode(), memoryview(record)[name_end + 8 :]


def read_whole(
    stream: BinaryIO, block: Block, ids: frozenset[int], declared: Declared, *, verify: bool
) -> WholeChunk | None:
    """The chunk of a block as it may be copied to where its channels are declared with these ids, None if it may not.

    Its CRC and its message indexes must be right, every schema and channel in it be what is declared, and no payload
    be compressed by itself: otherwise its messages have to be written anew.
    """
    if not block.is_chunk or block.is_cut or block.head or not (block.channel_ids is None or block.channel_ids <= ids):
        return None
    stream.seek(block.offset)
    record = read_up_to(stream, block.length)
    try:
        indexes = {channel_id: index for channel_id, index in _read_indexes(stream).items() if count_of(index)}
        chunk = _whole(record, indexes, declared, verify=verify)
    except (DamagedBlockError, McapError, EOFError, ValueError, struct_error):
        return None
    is_same = (chunk.log_time_ns, chunk.end_ns) == (block.start_ns, block.end_ns) and indexes.keys() <= ids
    return chunk if is_same else None


def _whole(record: bytes, indexes: Mapping[int, bytes], declared: Declared, *, verify: bool) -> WholeChunk:
    """A chunk with its message indexes, which name all in it but for what is declared.

    Raises:
        DamagedBlockError: they do not, or it is no chunk.
    """
    if record[:1] != bytes([Opcode.CHUNK]):
        raise DamagedBlockError("there is no chunk where the summary says")
    start_ns, end_ns, _, crc = CHUNK.unpack_from(record, RECORD.size)
    content = chunk_content(memoryview(record)[RECORD.size :], verify=verify)
    found = indexed(content, indexes)
    if found is None or (found.start_ns, found.end_ns) != (start_ns, end_ns):
        raise DamagedBlockError("its message index does not name what is in it")
    if not all(_is_declared(content[start:end], declared) for start, end in found.gaps):
        raise DamagedBlockError("what it declares is something else now")
    is_checked = verify and crc != 0 and not compressed(record)[0]
    counts = {channel_id: count_of(index) for channel_id, index in indexes.items()}
    return WholeChunk(start_ns, end_ns, record, indexes, counts, crc if is_checked else None)


def _read_indexes(stream: BinaryIO) -> dict[int, bytes]:
    """The message indexes from here on, by channel; of two of one channel none, so that they do not agree."""
    indexes: dict[int, bytes] = {}
    while True:
        head = stream.read(RECORD.size)
        opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
        if opcode != Opcode.MESSAGE_INDEX:
            return indexes
        index = head + read_up_to(stream, length)
        channel_id = int.from_bytes(index[RECORD.size : RECORD.size + 2], "little")
        entries = int.from_bytes(index[INDEX_HEAD - 4 : INDEX_HEAD], "little")
        if channel_id in indexes or len(index) != RECORD.size + length or len(index) != INDEX_HEAD + entries:
            raise DamagedBlockError("its message index is damaged")
        indexes[channel_id] = index


def _is_declared(stretch: memoryview, declared: Declared) -> bool:
    """Whether a stretch between messages holds nothing but schemas and channels that are declared so."""
    for opcode, start, end in records_in(stretch):
        if opcode == Opcode.SCHEMA:
            schema = parse(records.Schema, stretch[start:end])
            if declared.schemas.get(schema.id) != schema:
                return False
        elif opcode == Opcode.CHANNEL:
            channel = parse(records.Channel, stretch[start:end])
            if declared.channels.get(channel.id) != channel:
                return False
        else:
            return False
    return True
