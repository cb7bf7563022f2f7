"""What a file elsewhere is told of what will be read of it; files of this machine need none of that."""

import contextlib
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, BinaryIO

from mcap import records

from mcap_landmarks.recording.container import CHUNK, RECORD
from mcap_landmarks.remote.announced_file import AnnouncedFile, Part

if TYPE_CHECKING:
    from mcap_landmarks.recording.summary_index import Block  # which is read with what is here

_HEAD = RECORD.size + CHUNK.size + 4 + 4 + 8
"""Bytes of a chunk's record before its data, with the longest name of a compression."""
_BEGIN, _END = 4 << 10, 64 << 10
"""Of the header, and of the summary of a log of an hour with a few hundred chunks."""
_MOST_INDEXES = 1 << 20
"""Bytes behind a chunk in which its message indexes are looked for: those of 65,000 messages."""


def gather_ends(stream: BinaryIO, size: int) -> None:
    """What tells what a recording holds: its first and last bytes."""
    if isinstance(stream, AnnouncedFile):
        stream.gather([(0, _BEGIN), (size - _END, size)])


def gather_part(stream: BinaryIO, part: Part) -> None:
    """One part that is read each time that the recording is opened."""
    if isinstance(stream, AnnouncedFile):
        stream.gather([part])


def gather_indexed(stream: BinaryIO, chunks: Sequence[records.ChunkIndex], *, with_indexes: bool) -> None:
    """The heads of chunks, and where those are looked up, of their message indexes."""
    if isinstance(stream, AnnouncedFile):
        heads = [(chunk.chunk_start_offset, chunk.chunk_start_offset + _HEAD) for chunk in chunks]
        if with_indexes:
            heads += [(place, place + _HEAD) for chunk in chunks for place in chunk.message_index_offsets.values()]
        stream.gather(heads)


def gather_heads(stream: BinaryIO, blocks: Sequence["Block"]) -> None:
    """The heads of the chunks among some blocks."""
    if isinstance(stream, AnnouncedFile):
        stream.gather([(block.offset, block.offset + _HEAD) for block in blocks if block.is_chunk and not block.head])


@contextlib.contextmanager
def reading(
    stream: BinaryIO, blocks: Sequence["Block"], everything: "Sequence[Block] | None" = None
) -> Iterator[Sequence["Block"]]:
    """Blocks that are read in this order while the block runs; with `everything` their message indexes, too.

    These are taken to lie between a chunk and the next of all blocks.
    """
    if not isinstance(stream, AnnouncedFile):
        yield blocks
        return
    begins = sorted(block.offset for block in everything or ())

    def end_of(block: "Block") -> int:
        end = block.offset + block.length
        number = bisect_left(begins, end)
        if number == len(begins):
            return end
        return min(begins[number] + RECORD.size, end + _MOST_INDEXES)

    with stream.expecting((block.offset, end_of(block)) for block in blocks):
        yield blocks
