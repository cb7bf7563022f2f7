"""Chunks that go from one recording into another as they are: only those whose every record would be the same there."""

from collections.abc import Mapping
from dataclasses import dataclass
from struct import error as struct_error
from typing import BinaryIO

import numpy as np
from mcap import records
from mcap.exceptions import McapError
from numpy.typing import NDArray

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content, records_in
from mcap_landmarks.recording.container import CHUNK, MESSAGE, MESSAGE_FIXED, RECORD, Opcode, parse, read_up_to
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.summary_index import Block

_MESSAGE = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]
)
_ENTRY = np.dtype([("log", "<u8"), ("offset", "<u8")])
_INDEX_HEAD = RECORD.size + 6
"""Bytes of a message index before its entries: opcode, length, channel id, and how many bytes the entries have."""

_COMPRESSED = 0x28
"""First byte of payloads that rosbag2 compressed one by one with zstd (RFC 8878), and does not mark in MCAP."""


@dataclass(frozen=True, slots=True)
class WholeChunk:
    """The whole record of a chunk, and of its message indexes by channel. `log_time_ns` is its first message's."""

    log_time_ns: int
    end_ns: int
    record: bytes
    indexes: Mapping[int, bytes]
    counts: Mapping[int, int]


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
        chunk = _whole(record, {key: index for key, index in _read_indexes(stream).items() if len(index) > _INDEX_HEAD})
        content = chunk_content(memoryview(record)[RECORD.size :], verify=verify)
        is_same = (chunk.log_time_ns, chunk.end_ns) == (block.start_ns, block.end_ns) and chunk.counts.keys() <= ids
        return chunk if is_same and _agrees(content, _entries(chunk.indexes), declared) else None
    except (DamagedBlockError, McapError, EOFError, ValueError, struct_error):
        return None


def _whole(record: bytes, indexes: Mapping[int, bytes]) -> WholeChunk:
    """A chunk with its message indexes, which agree about its times.

    Raises:
        DamagedBlockError: they do not, or it is no chunk.
    """
    if record[:1] != bytes([Opcode.CHUNK]):
        raise DamagedBlockError("there is no chunk where the summary says")
    start_ns, end_ns, _, _ = CHUNK.unpack_from(record, RECORD.size)
    times = [each["log"] for each in _entries(indexes).values()]
    if not times or (min(map(np.min, times)), max(map(np.max, times))) != (start_ns, end_ns):
        raise DamagedBlockError("its times are not those of its message index")
    return WholeChunk(start_ns, end_ns, record, indexes, {key: len(t) for key, t in zip(indexes, times, strict=True)})


def _entries(indexes: Mapping[int, bytes]) -> dict[int, NDArray[np.void]]:
    return {key: np.frombuffer(index, _ENTRY, offset=_INDEX_HEAD) for key, index in indexes.items()}


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
        entries = int.from_bytes(index[_INDEX_HEAD - 4 : _INDEX_HEAD], "little")
        if channel_id in indexes or len(index) != RECORD.size + length or len(index) != _INDEX_HEAD + entries:
            raise DamagedBlockError("its message index is damaged")
        indexes[channel_id] = index


def _agrees(content: memoryview, entries: Mapping[int, NDArray[np.void]], declared: Declared) -> bool:
    """Whether the message indexes name each message of a chunk, and all that lies between these is declared."""
    index = np.concatenate(list(entries.values()))
    channels = np.repeat(np.array(list(entries), np.uint16), [len(each) for each in entries.values()])
    order = np.argsort(index["offset"], kind="stable")
    index, channels = index[order], channels[order]
    if int(index["offset"][-1]) + MESSAGE.size > len(content):
        return False
    starts = index["offset"].astype(np.int64)
    at_each_byte = np.ndarray((len(content) - MESSAGE.size + 1,), _MESSAGE, content, strides=(1,))
    found = at_each_byte[starts]
    is_message = (found["opcode"] == Opcode.MESSAGE) & (found["length"] >= MESSAGE_FIXED)
    is_indexed = (found["channel"] == channels) & (found["log"] == index["log"])
    if not (is_message & is_indexed & (found["length"] <= len(content))).all():
        return False
    payloads = starts[found["length"] > MESSAGE_FIXED] + MESSAGE.size
    if (np.frombuffer(content, np.uint8)[np.minimum(payloads, len(content) - 1)] == _COMPRESSED).any():
        return False
    ends = np.append(0, starts + RECORD.size + found["length"].astype(np.int64))
    nexts = np.append(starts, len(content))
    gaps = np.flatnonzero(ends != nexts)
    return bool((ends <= nexts).all()) and all(
        _is_declared(content[start:end], declared) for start, end in zip(ends[gaps], nexts[gaps], strict=True)
    )


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
