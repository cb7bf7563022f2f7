"""The records of a ROS 1 bag (format 2.0): headers, connections, chunks."""

import bz2
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

import lz4.frame

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
LARGEST_CHUNK = 1 << 30
"""A chunk that claims to be larger than this is taken for damage, and not allocated."""

_UINT32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_COUNT = struct.Struct("<II")
_INDEX_ENTRY = struct.Struct("<III")
Header = dict[bytes, bytes]


class DamagedBagError(ValueError):
    """A stretch of a bag that cannot be trusted; the message says why."""


class BagMessage(NamedTuple):
    """One message of a chunk, still in ROS 1's serialization."""

    time_ns: int
    connection_id: int
    data: memoryview


@dataclass(frozen=True, slots=True)
class BagConnection:
    """What a bag says about one publisher on a topic; `ros_type` is ROS 1's, as `nav_msgs/Odometry`."""

    topic: str
    ros_type: str
    definition: str
    latched: bool


@dataclass(frozen=True, slots=True)
class ChunkInfo:
    """Where a chunk record lies, the times in it, and how many messages of each connection it should hold."""

    offset: int
    start_ns: int
    end_ns: int
    counts: dict[int, int]


def read_exactly(stream: BinaryIO, size: int, remaining: int) -> bytes:
    """So many bytes, without allocating more than the file holds.

    Raises:
        DamagedBagError: the file ends before.
    """
    if size > remaining:
        raise DamagedBagError(f"a record claims {size} bytes where {max(remaining, 0)} are left")
    data = stream.read(size)
    if len(data) < size:
        raise DamagedBagError("the file ends within a record")
    return data


def read_header(stream: BinaryIO, size: int) -> tuple[Header, int]:
    """Header of the record at the stream's position, and the length of its data, where the stream then stands."""
    offset = stream.tell()
    length = uint32(read_exactly(stream, 4, size - offset))
    header = parse_header(memoryview(read_exactly(stream, length, size - offset - 4)))
    return header, uint32(read_exactly(stream, 4, size - offset - 4 - length))


def parse_header(data: memoryview) -> Header:
    """Fields of a header by name.

    Raises:
        DamagedBagError: the lengths in it do not add up.
    """
    fields: Header = {}
    position, end = 0, len(data)
    while position < end:
        start = position + 4
        if start > end:
            raise DamagedBagError("a header is cut")
        position = start + _UINT32.unpack_from(data, position)[0]
        if position > end:
            raise DamagedBagError("a header field is longer than its header")
        name, equals, value = bytes(data[start:position]).partition(b"=")
        if not equals:
            raise DamagedBagError("a header field has no name")
        fields[name] = value
    return fields


def uint32(value: bytes) -> int:
    """A number of 4 bytes.

    Raises:
        DamagedBagError: it has another length.
    """
    if len(value) != _UINT32.size:
        raise DamagedBagError("a number in a header has the wrong length")
    return int(_UINT32.unpack(value)[0])


def field(header: Header, name: bytes) -> bytes:
    """A field that has to be there.

    Raises:
        DamagedBagError: it is missing.
    """
    if name not in header:
        raise DamagedBagError(f"a header has no field {name.decode()}")
    return header[name]


def operation(header: Header) -> int:
    """Which kind of record a header belongs to."""
    return field(header, b"op")[0]


def time_ns(value: bytes) -> int:
    """Nanoseconds of a time field.

    Raises:
        DamagedBagError: it has the wrong length.
    """
    if len(value) != _TIME.size:
        raise DamagedBagError("a time in a header has the wrong length")
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds) * 10**9 + int(nanoseconds)


def parse_connection(header: Header, data: memoryview) -> tuple[int, BagConnection]:
    """Id and description from a connection record."""
    about = parse_header(data)
    connection = BagConnection(
        field(header, b"topic").decode(errors="replace"),
        field(about, b"type").decode(errors="replace"),
        about.get(b"message_definition", b"").decode(errors="replace"),
        about.get(b"latching") == b"1",
    )
    return uint32(field(header, b"conn")), connection


def parse_chunk_info(header: Header, data: bytes) -> ChunkInfo:
    """Place, times and counts from a chunk info record."""
    if len(data) % _COUNT.size:
        raise DamagedBagError("a chunk info record has the wrong length")
    return ChunkInfo(
        int.from_bytes(field(header, b"chunk_pos"), "little"),
        time_ns(field(header, b"start_time")),
        time_ns(field(header, b"end_time")),
        dict(_COUNT.iter_unpack(data)),
    )


def decompress(header: Header, data: bytes) -> tuple[memoryview, bool]:
    """Content of a chunk from its header and data, as far as it goes, and whether it is whole.

    Raises:
        DamagedBagError: the compression is unknown, or nothing can be decompressed.
    """
    compression, size = field(header, b"compression").decode(errors="replace"), uint32(field(header, b"size"))
    if size > LARGEST_CHUNK:
        raise DamagedBagError(f"it claims {size} bytes")
    try:
        if compression == "none":
            content = data
        elif compression == "bz2":
            content = bz2.BZ2Decompressor().decompress(data, size)
        elif compression == "lz4":
            content = lz4.frame.LZ4FrameDecompressor().decompress(data, size)
        else:
            raise DamagedBagError(f"its compression {compression!r} is unknown")
    except (OSError, RuntimeError, EOFError) as error:
        raise DamagedBagError(f"{compression} cannot decompress it") from error
    return memoryview(content), len(content) == size


def chunk_records(content: memoryview) -> Iterator[tuple[Header, memoryview]]:
    """Header and data of each record of a chunk, in the order written.

    Raises:
        DamagedBagError: the last one is cut.
    """
    position, end = 0, len(content)
    unpack = _UINT32.unpack_from
    while position < end:
        if position + 4 > end:
            raise DamagedBagError("a record in it is cut")
        start = position + 4
        stop = start + unpack(content, position)[0]
        if stop + 4 > end:
            raise DamagedBagError("a record in it is cut")
        data_start = stop + 4
        position = data_start + unpack(content, stop)[0]
        if position > end:
            raise DamagedBagError("a record in it is cut")
        yield parse_header(content[start:stop]), content[data_start:position]


def message_of(header: Header, data: memoryview) -> BagMessage:
    """The message of a message record."""
    return BagMessage(time_ns(field(header, b"time")), uint32(field(header, b"conn")), data)


def index_counts(header: Header, data: bytes) -> Counter[int]:
    """Messages by connection that an index record declares for the chunk before it."""
    if len(data) % _INDEX_ENTRY.size:
        raise DamagedBagError("an index record has the wrong length")
    return Counter({uint32(field(header, b"conn")): len(data) // _INDEX_ENTRY.size})
