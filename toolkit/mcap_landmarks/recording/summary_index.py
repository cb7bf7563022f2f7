"""What a recording holds and where: taken from its summary, where that can be trusted."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from struct import error as struct_error
from typing import BinaryIO

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks.recording.container import FOOTER_SIZE, MAGIC, RECORD, Opcode, parse


@dataclass(frozen=True, slots=True)
class Block:
    """A stretch of the file with messages: one chunk record, whole or cut by the end of the file, or loose messages.

    `channel_ids` are the channels that it has messages of, None where the summary does not say.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    is_chunk: bool = True
    is_cut: bool = False
    channel_ids: frozenset[int] | None = None


@dataclass(slots=True)
class Index:
    """Contents of a recording. `counts` are messages by channel id; `losses` say what of it cannot be read."""

    header: records.Header
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: list[int] = field(default_factory=list)
    start_ns: int | None = None
    end_ns: int | None = None
    losses: list[str] = field(default_factory=list)


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
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return opcode, content


def index_from_summary(stream: BinaryIO, size: int, header: records.Header) -> Index | None:
    """The index that the summary gives, None if it is missing, damaged or tells less than the file holds."""
    try:
        footer, section = _summary(stream, size)
        if footer is None:
            return None
        return _complete(_collect(stream, header, section))
    except (EOFError, McapError, struct_error, UnicodeDecodeError, IndexError, KeyError, MemoryError, OverflowError):
        return None


def _summary(stream: BinaryIO, size: int) -> tuple[records.Footer | None, bytes]:
    tail = FOOTER_SIZE + len(MAGIC)
    if size < tail:
        return None, b""
    stream.seek(size - tail)
    end = stream.read(tail)
    if end[-len(MAGIC) :] != MAGIC or end[0] != Opcode.FOOTER:
        return None, b""
    footer = parse(records.Footer, end[RECORD.size : FOOTER_SIZE])
    if not len(MAGIC) < footer.summary_start <= size - tail:
        return None, b""
    stream.seek(footer.summary_start)
    section = stream.read(size - tail - footer.summary_start)
    if footer.summary_crc and zlib.crc32(end[: FOOTER_SIZE - 4], zlib.crc32(section)) != footer.summary_crc:
        return None, b""
    return footer, section


def _each(section: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position < len(section):
        opcode, length = RECORD.unpack_from(section, position)
        position += RECORD.size
        if position + length > len(section):
            raise EOFError
        yield opcode, section[position : position + length]
        position += length


def _collect(stream: BinaryIO, header: records.Header, section: bytes) -> tuple[Index, records.Statistics | None]:
    index, statistics = Index(header), None
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
            chunk = parse(records.ChunkIndex, content)
            block = Block(
                chunk.chunk_start_offset,
                chunk.chunk_length,
                chunk.message_start_time,
                chunk.message_end_time,
                channel_ids=frozenset(chunk.message_index_offsets) or None,
            )
            index.blocks.append(block)
        elif opcode == Opcode.METADATA_INDEX:
            where = parse(records.MetadataIndex, content)
            record = parse(records.Metadata, read_record(stream, where.offset)[1])
            index.metadata[record.name] = record.metadata
        elif opcode == Opcode.ATTACHMENT_INDEX:
            index.attachments.append(parse(records.AttachmentIndex, content).offset)
    return index, statistics


def _complete(collected: tuple[Index, records.Statistics | None]) -> Index | None:
    """The index, if the statistics confirm that the summary repeats and indexes everything."""
    index, statistics = collected
    if statistics is None or not (_has_all(index, statistics) and _has_all_messages(index, statistics)):
        return None
    index.counts = dict(statistics.channel_message_counts)
    if statistics.message_count:
        index.start_ns, index.end_ns = statistics.message_start_time, statistics.message_end_time
    return index


def _has_all(index: Index, statistics: records.Statistics) -> bool:
    """Whether everything beside the messages is there that the statistics count, and each channel's schema."""
    counted = (
        statistics.channel_count,
        statistics.chunk_count,
        statistics.attachment_count,
        statistics.metadata_count,
    )
    schemas = {channel.schema_id for channel in index.channels.values()} - {0}  # 0 stands for none
    there = (len(index.channels), len(index.blocks), len(index.attachments), len(index.metadata))
    return counted == there and schemas <= set(index.schemas)


def _has_all_messages(index: Index, statistics: records.Statistics) -> bool:
    """Whether the counts by channel are whole, and what they count lies in a chunk."""
    counts = statistics.channel_message_counts
    if sum(counts.values()) != statistics.message_count or not set(counts) <= set(index.channels):
        return False
    return statistics.message_count == 0 or bool(index.blocks)
