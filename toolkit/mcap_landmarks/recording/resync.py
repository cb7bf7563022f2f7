"""Where a damaged recording goes on: the next place at which a record stands that can be trusted."""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import BinaryIO

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content, records_in
from mcap_landmarks.recording.container import LARGEST_CHUNK, MAGIC, RECORD, Opcode, read_up_to
from mcap_landmarks.recording.record_shapes import SHAPES, ReadAt, fits, head_at

_HEAD = re.compile(rb"[\x01-\x0f].{5}\x00\x00\x00", re.DOTALL)
"""A known opcode, and a length below 1 TiB."""
_CHUNKED = re.compile(
    rb"\x06.{5}\x00{3}.{28}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd)|\x07.{4}\x00{4}.{5}\x00", re.DOTALL
)
"""The heads of a chunk with its compression, and of a message index."""
_LONGEST = 48
_WINDOW = 1 << 20
_CHAIN = 3
"""So many records in a row that fit are no chance: three zero bytes alone come once in 16 MB of noise."""


@dataclass(slots=True)
class Resync:
    """Finds places in a stream of `size` bytes at which reading can go on.

    `channels` are those known so far: loose messages count only in a file without chunks, and only if they are of them.
    """

    stream: BinaryIO
    size: int
    channels: Callable[[], Collection[int]]
    budget: int = 0
    _chunked: bool | None = None

    def __post_init__(self) -> None:
        # Chunks are decompressed to prove them. A file of nothing but false chunks shall not take forever.
        self.budget = 8 * self.size + (64 << 20)

    def read(self, offset: int, size: int) -> bytes:
        """See `ReadAt`."""
        self.stream.seek(offset)
        return read_up_to(self.stream, size)

    def next(self, offset: int) -> int | None:
        """The first place from an offset on where a record stands, None if there is none."""
        start = offset
        while start < self.size:
            window = self.read(start, _WINDOW + RECORD.size)
            position = 0
            while (match := _HEAD.search(window, position)) and match.start() < _WINDOW:
                if self.is_record(start + match.start()):
                    return start + match.start()
                position = match.start() + 1
            start += _WINDOW
        return None

    def is_record(self, offset: int) -> bool:
        """Whether a record stands at an offset: a sound chunk, or some others that follow each other."""
        position = offset
        for _ in range(_CHAIN):
            opcode, length = head_at(self.read, position)
            if not self._stands(opcode, length, position):
                return False
            position += RECORD.size + length
            if opcode == Opcode.CHUNK or position >= self.size:
                return position <= self.size
            if opcode == Opcode.FOOTER:
                return self.read(position, len(MAGIC)) == MAGIC
        return True

    def _stands(self, opcode: int, length: int, position: int) -> bool:
        """Whether a record can stand at a place, as far as itself tells."""
        if opcode == Opcode.CHUNK:
            return self.is_chunk(position, length)
        if opcode == Opcode.MESSAGE:
            return self._loose(position, length)
        return fits(opcode, length, self.read, position + RECORD.size)

    def is_chunk(self, offset: int, length: int) -> bool:
        """Whether a chunk stands at an offset whose content proves it."""
        begin = offset + RECORD.size
        if begin + length > self.size or length > min(LARGEST_CHUNK, self.budget):
            return False
        if not fits(Opcode.CHUNK, length, self.read, begin):
            return False
        record = self.read(begin, length)
        self.budget -= length + int.from_bytes(record[16:24], "little")
        try:
            return all(opcode in SHAPES for opcode, _, _ in records_in(chunk_content(record, verify=True)))
        except DamagedBlockError:
            return False

    def _loose(self, offset: int, length: int) -> bool:
        if length < SHAPES[Opcode.MESSAGE][0] or self._has_chunks():
            return False
        known = self.channels()
        return not known or int.from_bytes(self.read(offset + RECORD.size, 2), "little") in known

    def _has_chunks(self) -> bool:
        """Whether anything in the file looks like a chunk or the index of one, damaged or not.

        Messages within a damaged chunk look like loose ones, and what its CRC would say of them is not known.
        """
        if self._chunked is None:
            self._chunked = any(self._looks_chunked(start) for start in range(0, self.size, _WINDOW))
        return self._chunked

    def _looks_chunked(self, start: int) -> bool:
        for match in _CHUNKED.finditer(self.read(start, _WINDOW + _LONGEST)):
            opcode, length = head_at(self.read, start + match.start())
            if length > 6 and fits(opcode, length, self.read, start + match.start() + RECORD.size):
                return True
        return False


def reader_of(stream: BinaryIO) -> ReadAt:
    """What reads so many bytes from a place of a stream on."""

    def read(offset: int, size: int) -> bytes:
        stream.seek(offset)
        return read_up_to(stream, size)

    return read
