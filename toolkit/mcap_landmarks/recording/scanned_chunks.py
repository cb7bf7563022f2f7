"""Chunks while a recording is scanned: sound, mended, cut, suspect, or there before."""

from collections import Counter

from mcap_landmarks.recording.blocks import DamagedBlockError, chunk_content, cut_chunk_content, records_in
from mcap_landmarks.recording.chunk_mending import mended_head
from mcap_landmarks.recording.container import CHUNK, LARGEST_CHUNK, MESSAGE_FIXED, RECORD, Opcode
from mcap_landmarks.recording.findings import Findings
from mcap_landmarks.recording.record_shapes import ReadAt
from mcap_landmarks.recording.summary_index import MESSAGE_START, Block

_HEAD = CHUNK.size + 4 + 4 + 8
"""Bytes of a chunk's fields before its data, with the longest name of a compression."""
_PIECE = 1 << 20
_FEWEST_ZEROS = 512
"""Disks lose whole sectors, of 512 bytes or more; a sound chunk may end in fewer zeros."""


class ScannedChunks:
    """Takes chunks one by one, and puts what they hold into the findings."""

    def __init__(self, read: ReadAt, size: int, found: Findings) -> None:
        self._read, self._size, self._found = read, size, found
        self._known: dict[bytes, list[tuple[int, int]]] = {}
        self._is_suspect_last = False

    def close(self) -> None:
        """What comes now is no message index of the last chunk any more."""
        self._is_suspect_last = False

    def take(self, offset: int, length: int) -> None:
        """A chunk that lies whole in the file."""
        record = self._read(offset + RECORD.size, length)
        known = self._known.setdefault(record[: CHUNK.size], [])
        if any(size == length and self._read(place + RECORD.size, size) == record for place, size in known):
            self._found.duplicates.append(offset)
            return
        known.append((offset, length))
        try:
            content = chunk_content(record, verify=True)
            self._fill(Block(offset, RECORD.size + length, 0, 0), content, is_verified=_crc(record) != 0)
        except DamagedBlockError as error:
            if self._mend(offset, record) is None and not self._take_before_zeros(offset, record):
                self._suspect(offset, record, str(error))

    def _take_before_zeros(self, offset: int, record: bytes) -> bool:
        """A chunk whose end is zeros up to the end of the file, as a crash leaves it: it is cut where these begin."""
        whole = record.rstrip(b"\0")
        end = offset + RECORD.size + len(record)
        is_rest_zero = all(not any(self._read(at, _PIECE)) for at in range(end, self._size, _PIECE))
        if len(record) - len(whole) < _FEWEST_ZEROS or not is_rest_zero:
            return False
        self._found.cut_at(offset, has_crc=_crc(record) != 0)
        try:
            content = cut_chunk_content(whole)
            self._fill(Block(offset, RECORD.size + len(whole), 0, 0, is_cut=True), content, is_verified=False)
        except DamagedBlockError:
            return False
        return True

    def take_message_index(self, offset: int, _length: int) -> None:
        """The index of a channel behind a chunk tells how many messages of it a suspect chunk should hold."""
        if self._is_suspect_last:
            entries = int.from_bytes(self._read(offset + RECORD.size + 2, 4), "little") // 16
            self._found.suspects[-1].messages = (self._found.suspects[-1].messages or 0) + entries

    def mend(self, offset: int, length: int) -> int | None:
        """Read a record whose head is damaged as a chunk; where it ends, None if nothing proves that it is one."""
        head = self._read(offset + RECORD.size, _HEAD)
        if len(head) < _HEAD:
            return None
        width = int.from_bytes(head[CHUNK.size : CHUNK.size + 4], "little")
        lengths = [length]
        if width <= 4:
            begin = CHUNK.size + 4 + width + 8
            lengths.append(begin + int.from_bytes(head[begin - 8 : begin], "little"))
        for claimed in dict.fromkeys(lengths):
            if claimed <= LARGEST_CHUNK and offset + RECORD.size + claimed <= self._size:
                end = self._mend(offset, self._read(offset + RECORD.size, claimed))
                if end is not None:
                    return end
        return None

    def _mend(self, offset: int, record: bytes) -> int | None:
        mended = mended_head(record)
        if mended is None:
            return None
        head, begin, length = mended
        start = offset + RECORD.size + begin
        try:
            content = chunk_content(head + record[begin : begin + length], verify=True)
            self._fill(Block(start, length, 0, 0, head=head), content, is_verified=True)
        except DamagedBlockError:
            return None
        self._found.remarks.append(f"the header of the chunk at byte {offset} is damaged; its CRC proves its messages")
        return start + length

    def take_cut(self, offset: int, length: int) -> int | None:
        """A chunk that the end of the file cuts; None if this is none."""
        record = self._read(offset + RECORD.size, self._size - offset - RECORD.size)
        width = int.from_bytes(record[CHUNK.size : CHUNK.size + 4], "little")
        begin = CHUNK.size + 4 + width + 8
        if width > 4 or begin > len(record):
            return None
        if begin + int.from_bytes(record[begin - 8 : begin], "little") != length or length > LARGEST_CHUNK:
            return None
        self._found.cut_at(offset, has_crc=_crc(record) != 0)
        try:
            content = cut_chunk_content(record)
            block = Block(offset, RECORD.size + len(record), 0, 0, is_cut=True)
            self._fill(block, content, is_verified=False)
        except DamagedBlockError as error:
            self._suspect(offset, record, str(error))
        return self._size

    def _fill(self, block: Block, content: memoryview, *, is_verified: bool) -> None:
        """Take a block for what its content says; nothing of it if that is damaged."""
        counts: Counter[int] = Counter()
        definitions = []
        first, last = 2**64 - 1, 0
        for opcode, start, end in records_in(content):
            if opcode == Opcode.MESSAGE:
                if end - start < MESSAGE_FIXED:
                    raise DamagedBlockError("a message in it is cut")
                channel_id, _, log_time = MESSAGE_START.unpack_from(content, start)
                counts[channel_id] += 1
                first, last = min(first, log_time), max(last, log_time)
            elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                definitions.append((opcode, bytes(content[start:end])))
        for opcode, record in definitions:
            self._found.define(opcode, record, 2 if is_verified else 1)
        self._found.counts.update(counts)
        self._found.add(block.holding(counts, first, last), is_verified=is_verified)

    def _suspect(self, offset: int, record: bytes, reason: str) -> None:
        """A chunk whose messages are left out; its definitions serve where there are no others."""
        self._found.suspect(offset, reason)
        self._is_suspect_last = True
        try:
            content = cut_chunk_content(record)
            for opcode, start, end in records_in(content):
                if opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                    self._found.define(opcode, bytes(content[start:end]), 0)
        except DamagedBlockError:
            return


def _crc(record: bytes) -> int:
    return int(CHUNK.unpack_from(record)[3])
