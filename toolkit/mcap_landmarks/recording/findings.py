"""What scanning a recording found so far, and the account that is made of it."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.recording.container import LARGEST_CHUNK, MAGIC, Opcode, parse
from mcap_landmarks.recording.damage import Damage, Stretch, SuspectChunk
from mcap_landmarks.recording.record_shapes import SHAPES, ReadAt, check_content
from mcap_landmarks.recording.summary_index import Block, Index
from mcap_landmarks.wording import counted

_NAMES = {
    Opcode.SCHEMA: "schema",
    Opcode.CHANNEL: "channel",
    Opcode.MESSAGE: "message",
    Opcode.CHUNK: "chunk",
    Opcode.METADATA: "metadata record",
    Opcode.ATTACHMENT: "attachment",
    Opcode.STATISTICS: "statistics record",
    Opcode.FOOTER: "footer",
}


@dataclass(slots=True)
class _Suspect:
    offset: int
    reason: str
    messages: int | None = None


@dataclass(slots=True)
class Findings:
    """Grows while a recording of `size` bytes is scanned into `index`.

    A definition has a rank: 2 if a CRC covers it, 1 if none does, 0 if that CRC does not match. The best one counts.
    """

    index: Index
    size: int
    remark: str
    counts: Counter[int] = field(default_factory=Counter)
    suspects: list[_Suspect] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)
    lost_records: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    duplicates: list[int] = field(default_factory=list)
    statistics: records.Statistics | None = None
    metadata_count: int = 0
    unverified: int = 0
    loose: int = 0
    cut: int | None = None
    cut_has_crc: bool = False
    is_cut_unverified: bool = False
    data_end: int | None = None
    data_crc: int = 0
    crc_matches: bool | None = None
    is_finished: bool = False
    _ranks: dict[tuple[int, int], int] = field(default_factory=dict)

    @property
    def channels(self) -> Collection[int]:
        """The ids of the channels known so far."""
        return self.index.channels

    def add(self, block: Block, *, is_verified: bool) -> None:
        """A block of messages."""
        self.index.blocks.append(block)
        if block.is_chunk and not is_verified and block.end_ns >= block.start_ns:
            self.unverified += 1
            self.is_cut_unverified |= block.is_cut and self.cut_has_crc
        self.loose += not block.is_chunk

    def suspect(self, offset: int, reason: str) -> None:
        """A chunk that is left out."""
        self.suspects.append(_Suspect(offset, reason))

    def cut_at(self, offset: int, *, has_crc: bool = False) -> None:
        """Where the record begins that the end of the file cuts, and whether it has a CRC."""
        self.cut, self.cut_has_crc = offset, has_crc

    def ends_with_magic(self, read: ReadAt) -> bool:
        """Whether the file ends as a finished one does."""
        return read(self.size - len(MAGIC), len(MAGIC)) == MAGIC

    def passed_over(self, start: int, end: int, opcode: int, length: int) -> None:
        """A stretch without records; what seemed to stand at its start had this opcode and length."""
        if opcode not in SHAPES:
            reason = "no record begins there"
        elif length > min(self.size, LARGEST_CHUNK):
            reason = f"a record of {length} bytes, which cannot be"
        else:
            reason = f"the {_NAMES.get(Opcode(opcode), 'record')} there is damaged"
        self.stretches.append(Stretch(start, end, reason))

    def define(self, opcode: int, content: bytes, rank: int) -> None:
        """A schema or channel."""
        try:
            check_content(opcode, content)
            if opcode == Opcode.SCHEMA:
                schema = parse(records.Schema, content)
                self._compare(opcode, schema.id, rank, self.index.schemas.get(schema.id, schema) == schema)
                if self._is_best(opcode, schema.id, rank):
                    self.index.schemas[schema.id] = schema
            else:
                channel = parse(records.Channel, content)
                self._compare(opcode, channel.id, rank, self.index.channels.get(channel.id, channel) == channel)
                if self._is_best(opcode, channel.id, rank):
                    self.index.channels[channel.id] = channel
        except (McapError, ValueError):
            self.remarks.append(f"the record of a {_NAMES[Opcode(opcode)]} is damaged")

    def _compare(self, opcode: int, key: int, rank: int, is_same: bool) -> None:
        """Say that one id has two definitions, of which nothing tells the better."""
        if not is_same and rank == self._ranks.get((opcode, key)):
            name = _NAMES[Opcode(opcode)]
            loss = f"the {name} {key} is defined twice, and differently; messages of both count as the last one's"
            self.lost_records.append(loss)

    def _is_best(self, opcode: int, key: int, rank: int) -> bool:
        if rank < self._ranks.get((opcode, key), 0):
            return False
        self._ranks[opcode, key] = rank
        return True

    def account(self) -> Damage:
        """The account, once everything was scanned; the index gets its counts and times."""
        self._fill_index()
        self._check_definitions()
        recovered = sum(count for key, count in self.index.counts.items() if key in self.index.channels)
        expected = self._expected(recovered)
        suspects = [SuspectChunk(one.offset, one.messages, one.reason) for one in self.suspects]
        return Damage(
            expected=expected,
            recovered=recovered,
            suspect_chunks=tuple(suspects),
            resyncs=tuple(self.stretches),
            cut=self._cut(),
            records=tuple(dict.fromkeys(self.lost_records)),
            unverified=0 if self.crc_matches else self.unverified,
            is_cut_unverified=self.is_cut_unverified,
            loose=0 if self.crc_matches else self.loose,
            duplicates=tuple(self.duplicates),
            remarks=tuple(dict.fromkeys(([self.remark] if self.remark else []) + self.remarks)),
            is_whole=self._is_whole(recovered, expected),
            crc_matches=self.crc_matches,
        )

    def _fill_index(self) -> None:
        index = self.index
        index.counts = {key: count for key, count in self.counts.items() if count}
        filled = [block for block in index.blocks if block.end_ns >= block.start_ns]
        index.start_ns = min((block.start_ns for block in filled), default=None)
        index.end_ns = max((block.end_ns for block in filled), default=None)

    def _check_definitions(self) -> None:
        channels, schemas = self.index.channels, self.index.schemas
        orphans = sum(count for key, count in self.index.counts.items() if key not in channels)
        if orphans:
            self.lost_records.append(f"{counted(orphans, 'message')} of channels that are nowhere described left out")
        for key in sorted(self.index.counts):
            channel = channels.get(key)
            if channel is not None and channel.schema_id and channel.schema_id not in schemas:
                self.lost_records.append(f"the definition of the messages of {channel.topic} is damaged or missing")

    def _expected(self, recovered: int) -> int | None:
        """What the statistics count, if they are sound; else what was found, where all that is missing is known."""
        if self.statistics is not None:
            count: int = self.statistics.message_count
            by_channel = self.statistics.channel_message_counts
            if count == sum(by_channel.values()) and count >= recovered and not self._counts_twice(count, recovered):
                return count
        known = [one.messages for one in self.suspects]
        if self.stretches or self.cut is not None or self.data_end is None or None in known:
            return None
        return self.counts.total() + sum(count or 0 for count in known)

    def _counts_twice(self, count: int, recovered: int) -> bool:
        """Whether a tool counted the chunks twice that are there twice."""
        return bool(self.duplicates) and count > recovered and not (self.suspects or self.stretches)

    def _is_whole(self, recovered: int, expected: int | None) -> bool:
        """Whether the statistics prove that nothing is missing."""
        told = self.statistics
        if told is None or expected != recovered or self.lost_records or self.suspects or self.cut is not None:
            return False
        there = (self.metadata_count, len(self.index.attachments))
        return there == (told.metadata_count, told.attachment_count)

    def _cut(self) -> str:
        if self.cut is None and (self.is_finished or (self.stretches and self.stretches[-1].end == self.size)):
            return ""
        at = self.size if self.cut is None else self.cut
        if self.data_end is not None:
            return f"the file is cut at byte {at} of {self.size}, behind its messages"
        return f"the file is cut at byte {at} of {self.size}; what follows is left out"
