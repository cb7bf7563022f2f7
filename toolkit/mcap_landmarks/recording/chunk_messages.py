"""The hot loops between a chunk's content and the messages that a reader gives, in the order of time."""

import heapq
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from struct import error as struct_error

from mcap_landmarks.recording.blocks import DamagedBlockError, records_in
from mcap_landmarks.recording.container import MESSAGE, MESSAGE_FIXED, RECORD, Opcode
from mcap_landmarks.stage import Connection, RawMessage

Open = list[tuple[int, int, int, int, Sequence[RawMessage]]]
"""A heap of blocks that are open: time of the next message, number of the block, that message's, the end, messages."""

_SMALL_BYTES = 4096
"""Payloads up to a page are copied: that takes as long as a view of them does, and no garbage has to be looked for."""


def messages_in(content: memoryview, wanted: Mapping[int, Connection]) -> list[RawMessage]:
    """The wanted channels' messages of some records, by log time; messages of equal time keep their order.

    Raises:
        DamagedBlockError: a record runs over the end, or is too short for what it is.
    """
    found: list[RawMessage] = []
    # This loop runs for every message that is read: everything in it is a local name, records are unpacked with their
    # first 31 bytes as messages in one go, and RawMessage's own constructor, written in Python, is passed over.
    append, unpack, get, new = found.append, MESSAGE.unpack_from, wanted.get, tuple.__new__
    data = bytes(content) if _begins_small(content) else content
    position, end, is_message = 0, len(content), Opcode.MESSAGE.value
    last, ordered, head, shortest, fixed = 0, True, RECORD.size, MESSAGE_FIXED, MESSAGE.size
    try:
        while position < end:
            opcode, length, channel_id, sequence, log_time, publish_time = unpack(data, position)
            start = position + fixed
            position += head + length
            if position > end:
                raise DamagedBlockError("a record in it is longer than the chunk")
            if opcode == is_message:
                if length < shortest:
                    raise DamagedBlockError("a message in it is cut")
                connection = get(channel_id)
                if connection is not None:
                    append(new(RawMessage, (connection, log_time, publish_time, sequence, data[start:position])))
                    if log_time < last:
                        ordered = False
                    last = log_time
    except struct_error:  # the last record is shorter than any message
        if any(opcode == is_message for opcode, _, _ in records_in(content[position:])):
            raise DamagedBlockError("a message in it is cut") from None
    if not ordered:
        found.sort(key=_log_time)
    return found


def _begins_small(content: memoryview) -> bool:
    return len(content) >= RECORD.size and RECORD.unpack_from(content)[1] <= _SMALL_BYTES


def is_alone(messages: Sequence[RawMessage], first_ns: int, last_ns: int, next_ns: int) -> bool:
    """Whether all of a block's messages lie in the stretch from `first_ns` to `last_ns`, and before the next block."""
    return bool(messages) and messages[0].log_time_ns >= first_ns and messages[-1].log_time_ns < min(last_ns, next_ns)


def push(active: Open, number: int, messages: Sequence[RawMessage], first_ns: int, last_ns: int) -> None:
    """Open a block: its messages from `first_ns` on and before `last_ns`, which are in the order of time."""
    if not messages:
        return
    begin, end = 0, len(messages)
    if messages[0].log_time_ns < first_ns:
        begin = bisect_left(messages, first_ns, key=_log_time)
    if messages[-1].log_time_ns >= last_ns:
        end = bisect_left(messages, last_ns, key=_log_time)
    if begin < end:
        heapq.heappush(active, (messages[begin].log_time_ns, number, begin, end, messages))


def drain(active: Open, until_ns: int) -> Iterator[Iterable[RawMessage]]:
    """Runs of messages before `until_ns`, in order, from the open blocks; of equal times the earlier block's first.

    A run lasts until another block has the next message; that of a block which overlaps with none is all of it.
    """
    while active and active[0][0] < until_ns:
        _, number, begin, end, messages = heapq.heappop(active)
        limit_ns = until_ns  # of the first message that is not in this run any more
        if active and active[0][0] < until_ns:
            limit_ns = active[0][0] + (number < active[0][1])
        if messages[end - 1].log_time_ns < limit_ns:
            yield messages if end - begin == len(messages) else map(messages.__getitem__, range(begin, end))
            continue
        stop = begin + 1  # most often few: blocks of two sensors take turns
        while messages[stop].log_time_ns < limit_ns:
            stop += 1
        yield map(messages.__getitem__, range(begin, stop))
        heapq.heappush(active, (messages[stop].log_time_ns, number, stop, end, messages))


def _log_time(message: RawMessage) -> int:
    return message.log_time_ns
