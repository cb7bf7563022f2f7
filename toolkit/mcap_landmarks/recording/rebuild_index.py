"""Index a recording that has no usable summary, by reading it once from the front in bounded memory."""

from collections import Counter
from typing import BinaryIO

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content, cut_chunk_content, records_in
from mcap_landmarks.recording.container import CHUNK, MAGIC, MESSAGE, MESSAGE_FIXED, RECORD, Opcode, parse
from mcap_landmarks.recording.summary_index import Block, Index

RUN_BYTES = 1 << 20
"""A run of messages outside chunks ends here, as our chunks do: each becomes one block, which is read whole."""


class _Run:
    """Messages outside chunks that follow each other, as one block."""

    def __init__(self, offset: int) -> None:
        self.offset = self.end = offset
        self.start_ns, self.end_ns = 2**64 - 1, 0

    def block(self) -> Block:
        return Block(self.offset, self.end - self.offset, self.start_ns, self.end_ns, is_chunk=False)


def index_by_scanning(stream: BinaryIO, size: int, header: records.Header) -> Index:
    """Everything up to the footer, or up to where the file is cut; `losses` says so then."""
    scanner = _Scanner(stream, size, header)
    scanner.run()
    return scanner.index


class _Scanner:
    def __init__(self, stream: BinaryIO, size: int, header: records.Header) -> None:
        self.index = Index(header)
        self._stream, self._size = stream, size
        self._counts: Counter[int] = Counter()
        self._run: _Run | None = None

    def run(self) -> None:
        offset, finished = len(MAGIC), False
        while not finished and offset < self._size:
            self._stream.seek(offset)
            head = self._stream.read(RECORD.size)
            length = RECORD.unpack(head)[1] if len(head) == RECORD.size else self._size
            if offset + RECORD.size + length > self._size:
                if head[:1] == bytes([Opcode.CHUNK]):
                    self._chunk(offset, self._stream.read(self._size - offset - RECORD.size), is_cut=True)
                break
            self._take(head[0], offset, length)
            finished = head[0] == Opcode.FOOTER
            offset += RECORD.size + length
        self._close_run()
        if not finished:
            self.index.losses.append(f"the file is cut at byte {offset} of {self._size}; what follows is left out")
        self.index.counts = dict(self._counts)
        self.index.start_ns = min((block.start_ns for block in self.index.blocks), default=None)
        self.index.end_ns = max((block.end_ns for block in self.index.blocks), default=None)

    def _take(self, opcode: int, offset: int, length: int) -> None:
        if opcode == Opcode.MESSAGE:
            self._message(offset, length)
            return
        self._close_run()
        if opcode == Opcode.CHUNK:
            self._chunk(offset, self._stream.read(length))
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            self._define(opcode, self._stream.read(length))
        elif opcode == Opcode.METADATA:
            record = parse(records.Metadata, self._stream.read(length))
            self.index.metadata[record.name] = record.metadata
        elif opcode == Opcode.ATTACHMENT:
            self.index.attachments.append(offset)

    def _message(self, offset: int, length: int) -> None:
        if length < MESSAGE_FIXED:
            self.index.losses.append(f"the message at byte {offset} is too short; it is left out")
            self._close_run()
            return
        fixed = self._stream.read(MESSAGE_FIXED)
        _, _, channel_id, _, log_time, _ = MESSAGE.unpack(bytes(RECORD.size) + fixed)
        if self._run is None:
            self._run = _Run(offset)
        self._run.end = offset + RECORD.size + length
        self._run.start_ns = min(self._run.start_ns, log_time)
        self._run.end_ns = max(self._run.end_ns, log_time)
        self._counts[channel_id] += 1
        if self._run.end - self._run.offset >= RUN_BYTES:
            self._close_run()

    def _close_run(self) -> None:
        if self._run is not None:
            self.index.blocks.append(self._run.block())
            self._run = None

    def _chunk(self, offset: int, record: bytes, *, is_cut: bool = False) -> None:
        try:
            content = cut_chunk_content(record) if is_cut else chunk_content(record, verify=True)
            found = list(records_in(content))
        except DamagedBlockError as error:
            self.index.losses.append(f"the chunk at byte {offset} is damaged ({error}); its messages are left out")
            return
        has_messages = False
        for opcode, start, end in found:
            if opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self._define(opcode, content[start:end])
            elif opcode == Opcode.MESSAGE:
                self._counts[int.from_bytes(content[start : start + 2], "little")] += 1
                has_messages = True
        if has_messages:
            first, last, _, _ = CHUNK.unpack_from(record)
            self.index.blocks.append(Block(offset, RECORD.size + len(record), first, last, is_cut=is_cut))

    def _define(self, opcode: int, content: bytes | memoryview) -> None:
        try:
            if opcode == Opcode.SCHEMA:
                schema = parse(records.Schema, content)
                self.index.schemas[schema.id] = schema
            else:
                channel = parse(records.Channel, content)
                self.index.channels[channel.id] = channel
        except (McapError, ValueError) as error:
            self.index.losses.append(f"a {'schema' if opcode == Opcode.SCHEMA else 'channel'} is damaged: {error}")
