"""Message indexes held against the messages of their chunk: whether they name each one, and what lies between these."""

from collections.abc import Mapping
from struct import Struct
from typing import NamedTuple

import numpy as np

from mcap_landmarks.recording.container import MESSAGE, MESSAGE_FIXED, RECORD, Opcode

INDEX_HEAD = RECORD.size + 6
"""Bytes of a message index before its entries: opcode, length, channel id, and how many bytes the entries have."""

_ENTRY = Struct("<QQ")  # log time, offset
_FEW = 100
"""NumPy takes about as long for one message as for a thousand, and Python for a hundred (70 us, CPython 3.11)."""

_MESSAGES = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]
)
_OPCODE = Opcode.MESSAGE.value
_COMPRESSED = 0x28
"""First byte of payloads that rosbag2 compressed one by one with zstd (RFC 8878), and does not mark in MCAP."""


class Indexed(NamedTuple):
    """First and last log time of the messages of a chunk, and the stretches of its content between messages."""

    start_ns: int
    end_ns: int
    gaps: list[tuple[int, int]]


def count_of(index: bytes) -> int:
    """How many messages the whole record of a message index names."""
    return (len(index) - INDEX_HEAD) // _ENTRY.size


def indexed(content: memoryview, indexes: Mapping[int, bytes]) -> Indexed | None:
    """What the whole records of message indexes, by channel, name in the content of their chunk.

    None if they name no message, one that is not there, or one whose payload is compressed by itself.
    """
    count = sum(map(count_of, indexes.values()))
    if not count:
        return None
    return _few(content, indexes) if count <= _FEW else _many(content, indexes)


def _few(content: memoryview, indexes: Mapping[int, bytes]) -> Indexed | None:
    entries = sorted(
        (offset, time_ns, channel_id)
        for channel_id, index in indexes.items()
        for time_ns, offset in _ENTRY.iter_unpack(memoryview(index)[INDEX_HEAD:])
    )
    position, gaps = 0, []
    for start, time_ns, channel_id in entries:
        end = _message_end(content, start, (_OPCODE, channel_id, time_ns))
        if end is None or start < position:
            return None
        if position < start:
            gaps.append((position, start))
        position = end
    if position < len(content):
        gaps.append((position, len(content)))
    times = [time_ns for _, time_ns, _ in entries]
    return Indexed(min(times), max(times), gaps)


def _message_end(content: memoryview, start: int, named: tuple[int, int, int]) -> int | None:
    """Where the message ends that begins there; None if it has not this opcode, channel and log time, or is no good."""
    if start + MESSAGE.size > len(content):
        return None
    opcode, length, channel_id, _, time_ns, _ = MESSAGE.unpack_from(content, start)
    end = int(start + RECORD.size + length)
    if (opcode, channel_id, time_ns) != named or length < MESSAGE_FIXED or end > len(content):
        return None
    is_compressed = length > MESSAGE_FIXED and content[start + MESSAGE.size] == _COMPRESSED
    return None if is_compressed else end


def _many(content: memoryview, indexes: Mapping[int, bytes]) -> Indexed | None:
    tables = [np.frombuffer(index, "<u8", offset=INDEX_HEAD).reshape(-1, 2) for index in indexes.values()]
    table = np.concatenate(tables)
    channels = np.repeat(np.array(list(indexes), np.uint16), [len(each) for each in tables])
    order = np.argsort(table[:, 1], kind="stable")
    times_ns, offsets, size = table[order, 0], table[order, 1], len(content)
    if int(offsets[-1]) + MESSAGE.size > size:
        return None
    starts = offsets.astype(np.int64)
    found = np.ndarray((size - MESSAGE.size + 1,), _MESSAGES, content, strides=(1,))[starts]
    lengths = found["length"]
    is_message = (found["opcode"] == _OPCODE) & (lengths >= MESSAGE_FIXED) & (lengths <= size)
    if not (is_message & (found["channel"] == channels[order]) & (found["log"] == times_ns)).all():
        return None
    first_bytes = np.frombuffer(content, np.uint8).take(starts + MESSAGE.size, mode="clip")
    ends, nexts = np.append(0, starts + lengths.astype(np.int64) + RECORD.size), np.append(starts, size)
    if ((first_bytes == _COMPRESSED) & (lengths > MESSAGE_FIXED)).any() or (ends > nexts).any():
        return None
    gaps = np.flatnonzero(ends != nexts)
    return Indexed(int(times_ns.min()), int(times_ns.max()), list(zip(ends[gaps], nexts[gaps], strict=True)))
