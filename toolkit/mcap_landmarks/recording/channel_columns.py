"""Columns of a channel's messages: found by the message indexes of their chunks, and gathered without a loop."""

from array import array
from collections.abc import Collection
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.messages.columns import Table
from mcap_landmarks.messages.gathered_rows import Gathered, Indices, Room, in_order
from mcap_landmarks.messages.gathering import Form, PlacedMessages, read_placed
from mcap_landmarks.messages.layout import Layout
from mcap_landmarks.recording.blocks import DamagedBlockError, records_in
from mcap_landmarks.recording.container import MESSAGE, MESSAGE_FIXED, RECORD, Opcode
from mcap_landmarks.recording.summary_index import Block

_HEAD = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]
)
"""What messages begin with, as in `MESSAGE`."""
_LATEST = np.uint64(2**63 - 1)
Heads = NDArray[np.void]


@dataclass(frozen=True, slots=True, eq=False)
class ChannelColumns:
    """The columns of N messages of a channel by log time, and these times (N,) in ns: 2^63 - 1 stands for later ones.

    `broken` counts the messages that do not fit their type, and have no row.
    """

    log_time_ns: Indices
    publish_time_ns: Indices
    table: Table
    broken: int = 0


class BlockRows(NamedTuple):
    """What a block gives: log and publish times (N,), the columns, and how many messages could not be read."""

    log: NDArray[np.uint64]
    publish: NDArray[np.uint64]
    table: Table
    broken: int


class Wanted(NamedTuple):
    """Which messages are wanted: of a channel, from a log time on and before another; and what of them.

    `known` is for `read_placed`: the form of the last block's messages, which the next one's most often have, too.
    """

    channel_id: int
    layout: Layout
    fields: Collection[str]
    within_ns: tuple[int, int]
    known: list[Form]


class GatheredBlocks:
    """The rows of blocks, which come by their start; so many are expected. `empty` is a table of their columns."""

    def __init__(self, empty: Table, expected: int) -> None:
        self._expected, self._broken = expected, 0
        self._log, self._publish, self._table = Room(), Room(), Gathered(empty, expected)

    def add(self, rows: BlockRows) -> None:
        """Take the rows of the next block."""
        self._log.add(rows.log, self._expected)
        self._publish.add(rows.publish, self._expected)
        self._table.add(rows.table)
        self._broken += rows.broken

    def columns(self) -> ChannelColumns:
        """All rows in the order of log time; those of equal time keep their order."""
        log, publish, table = self._log.filled, self._publish.filled, self._table.table()
        if (log[1:] < log[:-1]).any():
            order = np.argsort(log, kind="stable")
            log, publish, table = log[order], publish[order], in_order(table, order)
        return ChannelColumns(_signed(log), _signed(publish), table, self._broken)


def rows_in(stream: BinaryIO, block: Block, asked: Wanted, content: memoryview) -> BlockRows:
    """The rows of a block's wanted messages, in the order of the file.

    Raises:
        DamagedBlockError: a record runs over the end, or is too short for what it is.
    """
    first_ns, last_ns = asked.within_ns
    is_whole = first_ns <= block.start_ns and block.end_ns < last_ns
    if is_whole and (rows := _rows_of_one_size(content, asked)) is not None:
        return rows
    heads, starts = _messages(stream, block, content)
    wanted = heads["channel"] == asked.channel_id
    if not is_whole:
        wanted &= (heads["log"] >= np.uint64(max(first_ns, 0))) & (heads["log"] <= np.uint64(last_ns - 1))
    sizes = heads["length"][wanted].astype(np.int64) - MESSAGE_FIXED
    messages = PlacedMessages(content, starts[wanted] + MESSAGE.size, sizes)
    table, is_read = read_placed(asked.layout, messages, asked.fields, asked.known)
    log, publish = (heads[name][wanted][is_read] for name in ("log", "publish"))
    return BlockRows(log, publish, table, len(messages) - table.rows)


def _rows_of_one_size(content: memoryview, asked: Wanted) -> BlockRows | None:
    """The rows of a content with wanted messages of one size only, behind what is declared; None for any other.

    Each then begins where the one before ends, so that their heads tell as much as a look at one after the other.
    """
    first, size = _first_message(content)
    count, rest = divmod(len(content) - first, size or 1)
    if not size or rest:
        return None
    heads = np.ndarray((count,), _HEAD, content, first, (size,))
    is_message = (heads["opcode"] == Opcode.MESSAGE) & (heads["channel"] == asked.channel_id)
    if not (is_message & (heads["length"] == size - RECORD.size)).all():
        return None
    starts = np.arange(first + MESSAGE.size, len(content) + MESSAGE.size, size)
    messages = PlacedMessages(content, starts, np.full(count, size - MESSAGE.size), size)
    table, is_read = read_placed(asked.layout, messages, asked.fields, asked.known)
    if table.rows < count:
        heads = heads[is_read]
    return BlockRows(heads["log"], heads["publish"], table, count - table.rows)


def _first_message(content: memoryview) -> tuple[int, int]:
    """Where the first message record begins, and its size; 0 where there is none."""
    position = 0
    while position + MESSAGE.size <= len(content):
        opcode, length = RECORD.unpack_from(content, position)
        if opcode == Opcode.MESSAGE:
            return position, RECORD.size + max(length, MESSAGE_FIXED)
        position += RECORD.size + length
    return 0, 0


def _signed(times_ns: NDArray[np.uint64]) -> Indices:
    return np.minimum(times_ns.astype(np.uint64), _LATEST).astype(np.int64)


def _messages(stream: BinaryIO, block: Block, content: memoryview) -> tuple[Heads, Indices]:
    """The heads of all messages in a block's content (N,) and where they start, in the order of the file.

    Those that the message indexes name, if there is no other message; else every record is looked at.
    """
    if (starts := _indexed(stream, block, content)) is not None:
        heads = _heads(content, starts)
        if _are_all(content, starts, heads):
            return heads, starts
    found = array("q")
    for opcode, start, end in records_in(content):
        if opcode == Opcode.MESSAGE:
            if end - start < MESSAGE_FIXED:
                raise DamagedBlockError("a message in it is cut")
            found.append(start - RECORD.size)
    starts = np.asarray(found)
    return _heads(content, starts), starts


def _heads(content: memoryview, starts: Indices) -> Heads:
    nothing = np.zeros(len(starts), dtype=np.int64)
    return PlacedMessages(content, starts, nothing).gather(0, np.dtype(f"V{_HEAD.itemsize}")).view(_HEAD)


def _indexed(stream: BinaryIO, block: Block, content: memoryview) -> Indices | None:
    """Where messages start that the message indexes behind a chunk name; None where there are none, or they cannot be.

    Only the places are taken from there. What they say of channels and times stands with the messages.
    """
    if not block.is_chunk or block.is_cut or block.head:
        return None
    most, found = 6 + 16 * (len(content) // MESSAGE.size), [np.zeros(0, dtype=np.uint64)]
    stream.seek(block.offset + block.length)
    while len(head := stream.read(RECORD.size)) == RECORD.size:
        opcode, length = RECORD.unpack(head)
        if opcode != Opcode.MESSAGE_INDEX or not 6 <= length <= most or (length - 6) % 16:
            break
        if len(record := stream.read(length)) < length:
            return None
        found.append(np.frombuffer(record, "<u8", offset=6)[1::2])
    offsets = np.sort(np.concatenate(found))
    if not len(offsets) or offsets[-1] + np.uint64(MESSAGE.size) > len(content):
        return None
    return offsets.astype(np.int64)


def _are_all(content: memoryview, starts: Indices, heads: Heads) -> bool:
    """Whether records at these places are messages, do not overlap, and there is none between them."""
    length = heads["length"].astype(np.int64)  # one beyond 2^63 is negative then
    if (heads["opcode"] != Opcode.MESSAGE).any() or length.min() < MESSAGE_FIXED or length.max() > len(content):
        return False
    ends = np.concatenate([[0], starts + length + RECORD.size])
    begins = np.concatenate([starts, [len(content)]])
    gaps = np.flatnonzero(begins != ends)  # most often one, of the definitions at the chunk's begin
    if (begins[gaps] < ends[gaps]).any():
        return False
    try:
        between = [content[ends[gap] : begins[gap]] for gap in gaps.tolist()]
        return all(opcode != Opcode.MESSAGE for piece in between for opcode, _, _ in records_in(piece))
    except DamagedBlockError:
        return False
