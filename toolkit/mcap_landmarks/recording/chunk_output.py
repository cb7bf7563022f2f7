"""The bytes of a recording on their way to its file: in order, with their CRC; chunks are compressed beside."""

import hashlib
import sys
from array import array
from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from struct import Struct
from typing import BinaryIO, NamedTuple

import lz4.frame
from mcap import records
from zstandard import ZstdCompressor

from mcap_landmarks.recording.checksum import crc32, crc32_after
from mcap_landmarks.recording.chunk_copy import WholeChunk, compressed
from mcap_landmarks.recording.chunk_form import Buffer, ChunkForm, OpenChunk
from mcap_landmarks.recording.container import CHUNK, RECORD, Opcode

_LENGTH, _LENGTH_8 = Struct("<I"), Struct("<Q")
_INDEX = Struct("<BQHI")  # opcode, length, channel, bytes of the entries
_MOST_WAITING = 16 << 20
"""Bytes of chunks that wait for their turn: some sixteen usual ones, more than are filled while one is compressed."""


class _PackedChunk(NamedTuple):
    """A chunk as it is written: its record up to the data, these in pieces and with their CRC, and message indexes."""

    head: bytes
    data: Sequence[Buffer]
    data_crc: int | None
    indexes: Mapping[int, bytes]


class ChunkOutput:
    """Writes what comes, in the order in which it comes; made by the writer, who closes it.

    Chunks are compressed by a thread of its own, which lets others run meanwhile: what is written is the same without.
    """

    def __init__(self, stream: BinaryIO, form: ChunkForm) -> None:
        self._content = hashlib.sha256()
        self._stream, self._form = stream, form
        self._offset = self._crc = 0
        self._indexes: list[records.ChunkIndex] = []
        self._compress = lz4.frame.compress if form.compression == "lz4" else ZstdCompressor(level=3).compress
        self._beside = ThreadPoolExecutor(max_workers=1)
        self._waiting: deque[tuple[int, _PackedChunk | Future[_PackedChunk]]] = deque()
        self._waiting_bytes = 0

    def close(self) -> None:
        """End the thread; what waits for it is lost unless it was written."""
        self._beside.shutdown(cancel_futures=True)

    @property
    def chunk_indexes(self) -> list[records.ChunkIndex]:
        """Of all chunks that came."""
        self._write_waiting(0)
        return self._indexes

    @property
    def content_hash(self) -> str:
        """The hash over what stands for the chunks: their times, sizes and CRCs."""
        self._write_waiting(0)
        return self._content.hexdigest()

    @property
    def crc(self) -> int:
        """That of all that came."""
        self._write_waiting(0)
        return self._crc

    @property
    def offset(self) -> int:
        """Where the next byte will lie."""
        self._write_waiting(0)
        return self._offset

    def put(self, data: bytes) -> None:
        """Write whole records."""
        self._write_waiting(0)
        self._put(data)

    def chunk(self, chunk: OpenChunk) -> None:
        """Write a chunk."""
        packed = self._beside.submit(self._packed, chunk) if chunk.compressed else self._packed(chunk)
        self._wait(chunk.size, packed)

    def copy(self, chunk: WholeChunk) -> None:
        """Write a chunk as it is."""
        data = compressed(chunk.record)[1]
        head = chunk.record[: len(chunk.record) - len(data)]
        self._wait(len(data), _PackedChunk(head, [data], chunk.checked_crc, chunk.indexes))

    def _packed(self, chunk: OpenChunk) -> _PackedChunk:
        pieces = chunk.pieces
        if chunk.compressed:
            whole = pieces[0] if len(pieces) == 1 else b"".join(pieces)
            compression, content, crc = self._form.compression.encode(), [self._compress(whole)], crc32(whole)
        else:
            compression, content, crc = b"", pieces, 0
            for piece in pieces:
                crc = crc32(piece, crc)
        length = sum(map(len, content))
        head = CHUNK.pack(chunk.start_ns, chunk.end_ns, chunk.size, crc)
        head += _LENGTH.pack(len(compression)) + compression + _LENGTH_8.pack(length)
        indexes = {channel_id: _index(channel_id, entries) for channel_id, entries in sorted(chunk.index.items())}
        return _PackedChunk(
            RECORD.pack(Opcode.CHUNK, len(head) + length) + head, content, None if compression else crc, indexes
        )

    def _wait(self, size: int, packed: _PackedChunk | Future[_PackedChunk]) -> None:
        self._waiting.append((size, packed))
        self._waiting_bytes += size
        self._write_waiting(_MOST_WAITING)

    def _write_waiting(self, most: int) -> None:
        """Write the chunks whose turn it is; wait for some if more bytes are left than `most`."""
        while self._waiting:
            size, packed = self._waiting[0]
            if isinstance(packed, Future):
                if self._waiting_bytes <= most and not packed.done():
                    return
                packed = packed.result()
            self._waiting.popleft()
            self._waiting_bytes -= size
            self._put_chunk(packed)

    def _put_chunk(self, chunk: _PackedChunk) -> None:
        start, length, offsets = self._offset, sum(map(len, chunk.data)), {}
        start_ns, end_ns, size, _ = CHUNK.unpack_from(chunk.head, RECORD.size)
        self._content.update(chunk.head[RECORD.size : RECORD.size + CHUNK.size])
        self._put(chunk.head)
        if chunk.data_crc is None:
            for piece in chunk.data:
                self._put(piece)
        else:
            for piece in chunk.data:
                self._stream.write(piece)
            self._offset += length
            self._crc = crc32_after(chunk.data, chunk.data_crc, self._crc)
        for channel_id, index in chunk.indexes.items():
            offsets[channel_id] = self._offset
            self._put(index)
        self._indexes.append(
            records.ChunkIndex(
                chunk_length=len(chunk.head) + length,
                chunk_start_offset=start,
                compression=chunk.head[RECORD.size + CHUNK.size + _LENGTH.size : -_LENGTH_8.size].decode(),
                compressed_size=length,
                message_end_time=end_ns,
                message_index_length=self._offset - start - len(chunk.head) - length,
                message_index_offsets=offsets,
                message_start_time=start_ns,
                uncompressed_size=size,
            )
        )

    def _put(self, data: Buffer) -> None:
        self._stream.write(data)
        self._offset += len(data)
        self._crc = crc32(data, self._crc)


def _index(channel_id: int, entries: "array[int]") -> bytes:
    """The record of a message index."""
    if sys.byteorder == "big":
        entries.byteswap()
    content = entries.tobytes()
    return (
        _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX.size - RECORD.size + len(content), channel_id, len(content)) + content
    )
