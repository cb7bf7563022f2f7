"""Index a recording by reading it once from the front, in bounded memory: for want of a summary that can be trusted."""

import contextlib
from collections.abc import Callable
from typing import BinaryIO

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import LARGEST_CHUNK, MAGIC, MESSAGE_FIXED, RECORD, Opcode, parse
from mcap_landmarks.recording.findings import Findings
from mcap_landmarks.recording.loose_messages import LooseMessages
from mcap_landmarks.recording.record_shapes import fields_end, fits, head_at
from mcap_landmarks.recording.resync import Resync, reader_of
from mcap_landmarks.recording.scanned_chunks import ScannedChunks
from mcap_landmarks.recording.summary_index import Index, read_summary

_PIECE = 1 << 20


def index_by_scanning(
    stream: BinaryIO, size: int, header: records.Header, remark: str = "", progress: Progress | None = None
) -> Index:
    """Everything that is sound, from the front to the footer: behind what is damaged it goes on at the next record.

    `remark` says why the summary was not used; `progress` is told the bytes. The account is the `damage` of the index.
    """
    scanner = _Scanner(stream, size, header, remark)
    scanner.run(progress)
    return scanner.index


class _Scanner:
    def __init__(self, stream: BinaryIO, size: int, header: records.Header, remark: str) -> None:
        self.index = Index(header)
        self._found = found = Findings(self.index, size, remark)
        self._read, self._size = reader_of(stream), size
        self._resync = Resync(stream, size, lambda: found.channels)
        self._chunks = ScannedChunks(self._read, size, found)
        self._loose = LooseMessages(found)
        self._summary_rank = 1
        self._follows_chunk = False
        self._stream = stream
        self._handlers: dict[int, Callable[[int, int], None]] = {
            Opcode.SCHEMA: lambda offset, length: self._define(Opcode.SCHEMA, offset, length),
            Opcode.CHANNEL: lambda offset, length: self._define(Opcode.CHANNEL, offset, length),
            Opcode.CHUNK: self._chunks.take,
            Opcode.MESSAGE_INDEX: self._chunks.take_message_index,
            Opcode.METADATA: self._metadata,
            Opcode.ATTACHMENT: self._attachment,
            Opcode.STATISTICS: self._statistics,
            Opcode.DATA_END: self._data_end,
            Opcode.FOOTER: self._footer,
        }

    def run(self, progress: Progress | None) -> None:
        offset = len(MAGIC)
        while offset < self._size and not self._found.is_finished:
            begin = offset
            opcode, length = head_at(self._read, offset)
            if self._is_plausible(opcode, length, offset):
                self._take(opcode, offset, length)
                offset += RECORD.size + length
            else:
                offset = self._damaged(opcode, offset, length)
            if progress:
                progress(offset - begin)
        self._loose.close()
        if self._found.is_finished and offset + len(MAGIC) < self._size:
            self._found.remarks.append(f"{self._size - offset - len(MAGIC)} bytes behind its end are no part of it")
        self._check_data()
        self.index.damage = self._found.account()

    def _is_plausible(self, opcode: int, length: int, offset: int) -> bool:
        end = offset + RECORD.size + length
        if end > self._size or (opcode == Opcode.CHUNK and length > LARGEST_CHUNK):
            return False
        if opcode >= 0x80:  # private records, which readers pass over
            return end == self._size or self._resync.is_record(end)
        return fits(opcode, length, self._read, offset + RECORD.size)

    def _take(self, opcode: int, offset: int, length: int) -> None:
        if opcode == Opcode.MESSAGE and self._is_message_index(offset, length):
            self._found.remarks.append(f"the message index at byte {offset} is damaged, which tells of no message")
            opcode = Opcode.MESSAGE_INDEX
        self._follows_chunk = opcode in {Opcode.CHUNK, Opcode.MESSAGE_INDEX}
        if opcode != Opcode.MESSAGE_INDEX:
            self._chunks.close()
        if opcode == Opcode.MESSAGE:
            self._loose.take(offset, length, self._read(offset + RECORD.size, MESSAGE_FIXED))
            return
        self._loose.close()
        if opcode >= 0x80 and self._chunks.mend(offset, length) is not None:
            return
        handler = self._handlers.get(opcode)
        if handler:
            handler(offset, length)

    def _is_message_index(self, offset: int, length: int) -> bool:
        """Whether what stands for a message is the index of a chunk, of whose opcode one bit was flipped.

        An index has the length of its entries where a message has its sequence number.
        """
        entries = int.from_bytes(self._read(offset + RECORD.size + 2, 4), "little")
        return self._follows_chunk and entries == length - 6 and entries % 16 == 0

    def _damaged(self, opcode: int, offset: int, length: int) -> int:
        """Deal with what is no sound record; where to go on."""
        is_cut = not self._found.ends_with_magic(self._read)
        end = self._chunks.mend(offset, length)
        if end is None and opcode == Opcode.CHUNK and is_cut:
            end = self._chunks.take_cut(offset, length)
        if end is not None:
            self._loose.close()
            return end
        begin, found = self._next_record(offset)
        self._loose.close()
        self._chunks.close()
        if found is None and is_cut and self._could_be_cut(opcode, offset, length):
            self._found.cut_at(offset)
        else:
            self._found.passed_over(begin, found or self._size, opcode, length)
        return found or self._size

    def _next_record(self, offset: int) -> tuple[int, int | None]:
        """Where the damage at an offset begins, and the next record behind that.

        One may lie within the loose message before: then the length of that was damaged.
        """
        last = self._loose.last_offset
        found = self._resync.next((offset if last is None else last) + 1)
        if last is None or found is None or found > offset:
            return offset, found
        self._loose.drop_last()
        return last, found

    def _could_be_cut(self, opcode: int, offset: int, length: int) -> bool:
        if self._size - offset < RECORD.size:
            return True
        return 0 < opcode <= Opcode.DATA_END and self._size < offset + RECORD.size + length and length <= LARGEST_CHUNK

    def _content(self, offset: int, length: int) -> bytes:
        return self._read(offset + RECORD.size, length)

    def _define(self, opcode: int, offset: int, length: int) -> None:
        rank = self._summary_rank if self._found.data_end is not None else 1
        self._found.define(opcode, self._content(offset, length), rank)

    def _metadata(self, offset: int, length: int) -> None:
        try:
            record = parse(records.Metadata, self._content(offset, length))
        except (McapError, ValueError):
            self._found.lost_records.append(f"the metadata record at byte {offset} is damaged; it is left out")
        else:
            self.index.metadata_records.append((record.name, record.metadata))
            self._found.metadata_count += 1

    def _attachment(self, offset: int, length: int) -> None:
        begin = offset + RECORD.size
        end = begin + (fields_end(Opcode.ATTACHMENT, length, self._read, begin) or length) - 4
        crc = int.from_bytes(self._read(end, 4), "little")
        if crc and self._crc(begin, end) != crc:
            self._found.lost_records.append(f"the attachment at byte {offset} is damaged (its CRC does not match)")
        else:
            self.index.attachments.append(offset)

    def _crc(self, begin: int, end: int, crc: int = 0) -> int:
        for start in range(begin, end, _PIECE):
            crc = crc32(self._read(start, min(_PIECE, end - start)), crc)
        return crc

    def _statistics(self, offset: int, length: int) -> None:
        with contextlib.suppress(McapError, ValueError):  # nothing but a count to compare with is lost
            self._found.statistics = parse(records.Statistics, self._content(offset, length))

    def _data_end(self, offset: int, length: int) -> None:
        self._found.data_end = offset
        self._found.data_crc = int.from_bytes(self._content(offset, min(length, 4)), "little")
        summary = read_summary(self._stream, self._size)
        self._summary_rank = 1
        if summary.is_damaged:
            self._summary_rank = 0
        elif summary.footer is not None and summary.footer.summary_crc:
            self._summary_rank = 2

    def _footer(self, _offset: int, _length: int) -> None:
        self._found.is_finished = True

    def _check_data(self) -> None:
        """Hold the CRC over the data section against it, where there is one."""
        if self._found.data_end is not None and self._found.data_crc:
            self._found.crc_matches = self._crc(0, self._found.data_end) == self._found.data_crc
