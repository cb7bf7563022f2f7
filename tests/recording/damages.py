"""One recording of 1,080 messages, and what can happen to it: made by the mcap package and by hand."""

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mcap.writer import CompressionType, IndexType, Writer

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)
MESSAGES, CHANNELS = 1080, 6
Truth = tuple[str, int, int, bytes]  # topic, sequence, log time, data


@dataclass(frozen=True, slots=True)
class Record:
    """One record of a file: where it begins and ends."""

    opcode: int
    start: int
    end: int


def write(
    compression: str = "zstd", *, crcs: bool = True, summary: bool = True, chunked: bool = True
) -> tuple[bytes, list[Truth]]:
    """A recording and its messages: some 18 chunks of 60, an attachment and a metadata record in the middle."""
    stream = io.BytesIO()
    kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "": CompressionType.NONE}
    writer = Writer(
        stream,
        chunk_size=10_000,
        compression=kinds[compression],
        use_chunking=chunked,
        enable_crcs=crcs,
        index_types=IndexType.ALL if summary else IndexType.NONE,
        use_statistics=summary,
        use_summary_offsets=summary,
        repeat_channels=summary,
        repeat_schemas=summary,
    )
    writer.start(profile="ros2", library="by hand")
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
    channels = [
        writer.register_channel(f"/topic_{i}", "cdr", schema, {"offered_qos_profiles": ""}) for i in range(CHANNELS)
    ]
    truth = []
    for i in range(MESSAGES):
        data = b"\0\1\0\0" + struct.pack("<I", 120) + bytes((i * 7 + k * k) % 251 for k in range(120))
        time_ns = 1_700_000_000 * 10**9 + i * 10**7
        writer.add_message(channels[i % CHANNELS], time_ns, data, time_ns, i)
        truth.append((f"/topic_{i % CHANNELS}", i, time_ns, data))
        if i == MESSAGES // 2:
            writer.add_attachment(time_ns, time_ns, "notes.txt", "text/plain", b"what the operator saw " * 20)
            writer.add_metadata("robot", {"name": "seven", "wheels": "4"})
    writer.finish()
    return stream.getvalue(), truth


def records_of(data: bytes) -> list[Record]:
    """The records of a sound file."""
    found, position = [], len(MAGIC)
    while position < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, position)
        found.append(Record(opcode, position, position + 9 + length))
        position += 9 + length
    return found


def of_kind(data: bytes, opcode: int) -> list[Record]:
    """The records of one kind."""
    return [record for record in records_of(data) if record.opcode == opcode]


Damage = Callable[[bytes], bytes]


def put(data: bytes, offset: int, new: bytes) -> bytes:
    """The data with other bytes from an offset on."""
    return data[:offset] + new + data[offset + len(new) :]


def flip(data: bytes, offset: int, bits: int = 0x10) -> bytes:
    """The data with bits of one byte turned over."""
    return put(data, offset, bytes([data[offset] ^ bits]))


def _chunk(data: bytes, number: int) -> Record:
    return of_kind(data, CHUNK)[number]


def _no_summary_crc(data: bytes) -> bytes:
    return put(data, len(data) - 12, bytes(4))


def with_summary_crc(data: bytes) -> bytes:
    """The data with the CRC over the summary that it should have."""
    section = data[int.from_bytes(data[-28:-20], "little") : -12]
    return put(data, len(data) - 12, zlib.crc32(section).to_bytes(4, "little"))


def _flipped(share: float) -> Damage:
    def damage(data: bytes) -> bytes:
        chunk = _chunk(data, 7)
        return flip(data, chunk.start + 60 + int(share * (chunk.end - chunk.start - 60)))

    return damage


def _in_header(offset: int, new: bytes) -> Damage:
    """Another value in the header of a chunk: offset 1 is its length, 9 and 17 its times, 25 its size, 33 its CRC."""
    return lambda data: put(data, _chunk(data, 7).start + offset, new)


def _cut(share: float) -> Damage:
    return lambda data: data[: int(len(data) * share)]


def _cut_in_chunk(data: bytes) -> bytes:
    chunk = _chunk(data, 12)
    return data[: (chunk.start + chunk.end) // 2]


def _cut_in_summary(data: bytes) -> bytes:
    return data[: of_kind(data, STATISTICS)[0].start + 20]


def _without_end(data: bytes) -> bytes:
    return data[: of_kind(data, DATA_END)[0].start]


def _zeroed(data: bytes) -> bytes:
    chunk = _chunk(data, 7)
    return put(data, chunk.start - 2000, bytes(4096))


def _swap_index(data: bytes) -> bytes:
    """An index entry that names another chunk, with all that belongs to it."""
    first, second = of_kind(data, CHUNK_INDEX)[3:5]
    return _no_summary_crc(put(data, first.start, data[second.start : second.end]))


def _index_entry_off(data: bytes) -> bytes:
    entry = of_kind(data, CHUNK_INDEX)[3]
    offset = struct.unpack_from("<Q", data, entry.start + 25)[0]
    return _no_summary_crc(put(data, entry.start + 25, struct.pack("<Q", offset + 137)))


def _index_times(data: bytes) -> bytes:
    return _no_summary_crc(put(data, of_kind(data, CHUNK_INDEX)[3].start + 9, bytes(16)))


def _twice(data: bytes) -> bytes:
    """A chunk that is there twice, in a file without a summary."""
    chunk = _chunk(data, 7)
    return data[: chunk.end] + data[chunk.start :]


def _record(opcode: int, offset: int, number: int = 0) -> Damage:
    """A length inside a record becomes huge: at an offset behind its opcode and length."""
    return lambda data: put(data, of_kind(data, opcode)[number].start + 9 + offset, b"\xff\xff\xff\x7f")


DAMAGES: dict[str, tuple[dict[str, object], Damage]] = {
    "whole": ({}, lambda data: data),
    "cut in the middle": ({}, _cut(0.5)),
    "cut in a zstd chunk": ({}, _cut_in_chunk),
    "cut in an lz4 chunk": ({"compression": "lz4"}, _cut_in_chunk),
    "cut in a plain chunk": ({"compression": ""}, _cut_in_chunk),
    "cut in the summary": ({}, _cut_in_summary),
    "never finished": ({}, _without_end),
    "flipped early in a zstd chunk": ({}, _flipped(0.1)),
    "flipped late in a zstd chunk": ({}, _flipped(0.9)),
    "flipped in an lz4 chunk": ({"compression": "lz4"}, _flipped(0.5)),
    "flipped in a plain chunk": ({"compression": ""}, _flipped(0.5)),
    "flipped, no summary": ({"compression": "", "summary": False}, _flipped(0.5)),
    "flipped, no CRC": ({"compression": "", "crcs": False}, _flipped(0.5)),
    "chunk length": ({}, _in_header(1, b"\x01\x02")),
    "chunk times": ({}, _in_header(9, b"\xff" * 8)),
    "chunk size": ({}, _in_header(25, b"\x01\x02")),
    "chunk CRC": ({}, _in_header(33, b"\x01\x02")),
    "chunk compression": ({}, _in_header(41, b"zstx")),
    "chunk data length": ({}, _in_header(45, b"\x01\x02")),
    "huge length": ({}, _in_header(1, b"\xff" * 7 + b"\x7f")),
    "huge length, no summary": ({"summary": False}, _in_header(1, b"\xff" * 7 + b"\x7f")),
    "huge data length, no summary": ({"summary": False}, _in_header(45, b"\xff" * 7 + b"\x7f")),
    "zeroed block": ({}, _zeroed),
    "zeroed block, no summary": ({"summary": False, "compression": ""}, _zeroed),
    "wrong summary offset": ({}, lambda data: put(data, len(data) - 28, struct.pack("<Q", len(data) // 2))),
    "garbage after the footer": ({}, lambda data: data + b"garbage" * 100),
    "no summary": ({"summary": False}, lambda data: data),
    "index entry that is off": ({}, _index_entry_off),
    "index entry of another chunk": ({}, _swap_index),
    "index entry with other times": ({}, _index_times),
    "chunk there twice": ({"summary": False}, _twice),
    "message index": ({}, _record(MESSAGE_INDEX, 2, 9)),
    "metadata": ({}, _record(METADATA, 0)),
    "metadata, no summary": ({"summary": False}, _record(METADATA, 0)),
    "attachment, no summary": ({"summary": False}, _record(ATTACHMENT, 16)),
    "statistics": ({}, lambda data: put(data, of_kind(data, STATISTICS)[0].start + 9, b"\xff\xff\x01")),
    "channel in the summary": ({}, _record(CHANNEL, 4, -1)),
    "schema in the summary": ({}, _record(SCHEMA, 2, -1)),
    "first bytes": ({}, lambda data: b"PK\x03\x04" + data[4:]),
    "loose messages, huge length": (
        {"chunked": False, "summary": False},
        lambda data: put(data, of_kind(data, MESSAGE)[500].start + 1, b"\xff" * 7 + b"\x7f"),
    ),
    "loose messages, zeroed": (
        {"chunked": False, "summary": False},
        lambda data: put(data, of_kind(data, MESSAGE)[500].start + 5, bytes(1000)),
    ),
    "loose messages, cut": ({"chunked": False}, _cut(0.6)),
    "0 bytes": ({}, lambda _data: b""),
    "magic only": ({}, lambda _data: MAGIC),
    "not an MCAP": ({}, lambda data: b"PK\x03\x04" + data[4:-8]),
}
"""What happens to a file, and how that was written."""


def damaged() -> Iterator[tuple[str, bytes, list[Truth]]]:
    """Every damage by its name, with the file that has it and the messages of the sound one."""
    for name, (how, damage) in DAMAGES.items():
        data, truth = write(**how)  # type: ignore[arg-type]
        yield name, damage(data), truth
