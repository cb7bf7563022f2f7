"""What a recording holds and where: taken from its summary, where that can be trusted."""

import contextlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from struct import Struct
from struct import error as struct_error
from typing import BinaryIO, NamedTuple

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import FOOTER_SIZE, MAGIC, RECORD, Opcode, parse, read_up_to
from mcap_landmarks.recording.damage import Damage
from mcap_landmarks.recording.index_check import DistrustedIndexError, check_index
from mcap_landmarks.recording.reading_ahead import gather_part
from mcap_landmarks.stage import Connection

MESSAGE_START = Struct("<HIQ")
"""The first fields of a message: channel, sequence, log time."""
_CHUNK_INDEX, _PLACE, _BEHIND_PLACES, _SIZES = Struct("<QQQQI"), Struct("<HQ"), Struct("<QI"), Struct("<QQ")
"""The fields of a chunk index: times, place and length up to the length of the places of its message indexes, each of
these, what lies up to the name of the compression, and what behind."""


@dataclass(frozen=True, slots=True)
class Block:
    """A stretch of the file with messages: one chunk record, whole or cut by the end of the file, or loose messages.

    `channel_ids` are the channels that it has messages of, None where the summary does not say. `head` stands for the
    damaged header of a chunk, whose data alone lie at `offset`.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    is_chunk: bool = True
    is_cut: bool = False
    channel_ids: frozenset[int] | None = None
    head: bytes = b""

    def holding(self, channel_ids: Collection[int], start_ns: int, end_ns: int) -> "Block":
        """The block with what its messages say: their channels, and the first and last log time."""
        return replace(self, channel_ids=frozenset(channel_ids) or None, start_ns=start_ns, end_ns=end_ns)


MetadataRecord = tuple[str, Mapping[str, str]]
"""Name and entries; several records of a recording may have one name."""


@dataclass(slots=True)
class Index:
    """Contents of a recording. `counts` are messages by channel id; `damage` says what of it cannot be read."""

    header: records.Header
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    metadata_records: list[MetadataRecord] = field(default_factory=list)
    metadata_places: list[int] = field(default_factory=list)
    attachments: list[int] = field(default_factory=list)
    start_ns: int | None = None
    end_ns: int | None = None
    damage: Damage = field(default_factory=Damage)

    def connection(self, channel_id: int) -> Connection:
        """A channel with its schema."""
        channel = self.channels[channel_id]
        schema = self.schemas.get(channel.schema_id)
        name, content, encoding = (schema.name, schema.data, schema.encoding) if schema else ("", b"", "")
        return Connection(channel.topic, name, content, encoding, channel.message_encoding, channel.metadata)


def read_record(stream: BinaryIO, offset: int) -> tuple[int, bytes]:
    """Opcode and content of the record at an offset.

    Raises:
        EOFError: the file ends within it.
    """
    stream.seek(offset)
    head = stream.read(RECORD.size)
    if len(head) < RECORD.size:
        raise EOFError
    opcode, length = RECORD.unpack(head)
    content = read_up_to(stream, length)
    if len(content) < length:
        raise EOFError
    return opcode, content


class Summary(NamedTuple):
    """The end of a recording: its footer, None where there is none, and the records of its summary, if it has any."""

    footer: records.Footer | None
    section: bytes = b""
    is_damaged: bool = False


def indexed_messages(stream: BinaryIO, block: Block) -> int | None:
    """How many messages the message indexes behind a chunk list; None where there are none."""
    offset, total = block.offset + block.length, 0
    with contextlib.suppress(EOFError):
        opcode, content = read_record(stream, offset)
        while opcode == Opcode.MESSAGE_INDEX:
            total += (len(content) - 6) // 16
            offset += RECORD.size + len(content)
            opcode, content = read_record(stream, offset)
    return total or None


def index_from_summary(stream: BinaryIO, size: int, header: records.Header, data_start: int) -> Index | str:
    """The index that the summary gives, held against the records from `data_start` on that it names.

    Else why it cannot be used, in words; empty where there is none.
    """
    try:
        summary = read_summary(stream, size)
        if summary.footer is None or (not summary.section and not summary.is_damaged):
            return ""
        if summary.is_damaged:
            return "its summary is damaged; read from the front"
        index, chunks = _complete(*_collect(stream, header, summary.section))
        places = {*index.attachments, *index.metadata_places}
        is_covered = summary.footer.summary_crc != 0
        unverified = check_index(
            stream, (data_start, summary.footer.summary_start), chunks, places, is_covered=is_covered
        )
    except DistrustedIndexError as error:
        return f"its summary is not right ({error}); read from the front"
    except (EOFError, McapError, struct_error, UnicodeDecodeError, IndexError, KeyError, MemoryError, OverflowError):
        return "its summary is damaged; read from the front"
    total = sum(index.counts.values())
    index.damage = Damage(expected=total, recovered=total, unverified=unverified, is_whole=True)
    return index


def read_summary(stream: BinaryIO, size: int) -> Summary:
    """The end of a recording of so many bytes."""
    tail = FOOTER_SIZE + len(MAGIC)
    if size < tail:
        return Summary(None)
    stream.seek(size - tail)
    end = stream.read(tail)
    if end[-len(MAGIC) :] != MAGIC or end[0] != Opcode.FOOTER:
        return Summary(None)
    footer = parse(records.Footer, end[RECORD.size : FOOTER_SIZE])
    if footer.summary_start == 0:
        return Summary(footer)
    if not len(MAGIC) < footer.summary_start <= size - tail:
        return Summary(footer, is_damaged=True)
    gather_part(stream, (footer.summary_start, size))
    stream.seek(footer.summary_start)
    section = stream.read(size - tail - footer.summary_start)
    crc = crc32(end[: FOOTER_SIZE - 4], crc32(section))
    return Summary(footer, section, is_damaged=bool(footer.summary_crc) and crc != footer.summary_crc)


def _each(section: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position < len(section):
        opcode, length = RECORD.unpack_from(section, position)
        position += RECORD.size
        if position + length > len(section):
            raise EOFError
        yield opcode, section[position : position + length]
        position += length


def _collect(
    stream: BinaryIO, header: records.Header, section: bytes
) -> tuple[Index, list[records.ChunkIndex], records.Statistics | None]:
    index, chunks, statistics, named = Index(header), [], None, dict[int, MetadataRecord]()
    for opcode, content in _each(section):
        if opcode == Opcode.SCHEMA:
            schema = parse(records.Schema, content)
            index.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = parse(records.Channel, content)
            index.channels[channel.id] = channel
        elif opcode == Opcode.STATISTICS:
            statistics = parse(records.Statistics, content)
        elif opcode == Opcode.CHUNK_INDEX:
            chunks.append(_chunk_index(content))
        elif opcode == Opcode.METADATA_INDEX:
            where = parse(records.MetadataIndex, content)
            record = parse(records.Metadata, read_record(stream, where.offset)[1])
            named[where.offset] = (record.name, record.metadata)
            index.metadata_places.append(where.offset)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            index.attachments.append(parse(records.AttachmentIndex, content).offset)
    index.metadata_records = [named[place] for place in sorted(named)]
    chunks.sort(key=lambda chunk: chunk.chunk_start_offset)
    index.blocks = [_block(chunk) for chunk in chunks]
    return index, chunks, statistics


def _chunk_index(content: bytes) -> records.ChunkIndex:
    """What `parse` gives, in a tenth of the time: logs have thousands.

    Raises:
        EOFError, struct.error, UnicodeDecodeError: the content is none such.
    """
    start_ns, end_ns, offset, length, places_bytes = _CHUNK_INDEX.unpack_from(content)
    begin, end = _CHUNK_INDEX.size, _CHUNK_INDEX.size + places_bytes
    if places_bytes % _PLACE.size or end > len(content):
        raise EOFError
    index_length, name_length = _BEHIND_PLACES.unpack_from(content, end)
    name_end = end + _BEHIND_PLACES.size + name_length
    compressed, uncompressed = _SIZES.unpack_from(content, name_end)
    return records.ChunkIndex(
        chunk_length=length,
        chunk_start_offset=offset,
        compression=content[end + _BEHIND_PLACES.size : name_end].decode(),
        compressed_size=compressed,
        message_end_time=end_ns,
        message_index_length=index_length,
        message_index_offsets=dict(_PLACE.iter_unpack(content[begin:end])),
        message_start_time=start_ns,
        uncompressed_size=uncompressed,
    )


def _block(chunk: records.ChunkIndex) -> Block:
    return Block(
        chunk.chunk_start_offset,
        chunk.chunk_length,
        chunk.message_start_time,
        chunk.message_end_time,
        channel_ids=frozenset(chunk.message_index_offsets) or None,
    )


def _complete(
    index: Index, chunks: list[records.ChunkIndex], statistics: records.Statistics | None
) -> tuple[Index, list[records.ChunkIndex]]:
    """The index with the counts of the statistics.

    Raises:
        DistrustedIndexError: they do not confirm that the summary repeats and indexes everything.
    """
    if statistics is None or not (_has_all(index, statistics) and _has_all_messages(index, statistics)):
        raise DistrustedIndexError("it does not list everything")
    index.counts = dict(statistics.channel_message_counts)
    if statistics.message_count:
        index.start_ns, index.end_ns = statistics.message_start_time, statistics.message_end_time
    return index, chunks


def _has_all(index: Index, statistics: records.Statistics) -> bool:
    """Whether everything beside the messages is there that the statistics count, and each channel's schema."""
    counted = (
        statistics.channel_count,
        statistics.chunk_count,
        statistics.attachment_count,
        statistics.metadata_count,
    )
    schemas = {channel.schema_id for channel in index.channels.values()} - {0}  # 0 stands for none
    there = (len(index.channels), len(index.blocks), len(index.attachments), len(index.metadata_records))
    return counted == there and schemas <= set(index.schemas)


def _has_all_messages(index: Index, statistics: records.Statistics) -> bool:
    """Whether the counts by channel are whole, and what they count lies in a chunk."""
    counts = statistics.channel_message_counts
    if sum(counts.values()) != statistics.message_count or not set(counts) <= set(index.channels):
        return False
    return statistics.message_count == 0 or bool(index.blocks)
