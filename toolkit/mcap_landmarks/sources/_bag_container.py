"""The records of a ROS 1 bag (format 2.0): headers, connections, chunks."""

import bz2
import struct
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

import lz4.frame
import numpy as np

from mcap_landmarks import memory
from mcap_landmarks.sources._definition_text import decoded

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
"""The operations of records, as the rosbag format 2.0 numbers them (wiki.ros.org/Bags/Format/2.0)."""
LARGEST_CHUNK = 1 << 30
"""A chunk that claims to be larger than this is taken for damage, and not allocated."""

_UINT32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_COUNT = struct.Struct("<II")
_INDEX_ENTRY = struct.Struct("<III")
_OP_FIELD, _CONN_FIELD, _TIME_FIELD = b"\x04\0\0\0op=\x02", b"\x09\0\0\0conn=", b"\x0d\0\0\0time="
_MESSAGE_HEADER = 8 + 13 + 17
"""Bytes of the usual header: the fields op, conn and time, each with its length before it."""
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
    md5sum: str = ""


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
        decoded(about.get(b"message_definition", b"")),
        about.get(b"latching") == b"1",
        about.get(b"md5sum", b"").decode(errors="replace"),
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
    if problem := memory.excess(size, len(data)):
        raise DamagedBagError(problem)
    try:
        if compression == "none":
            content = data
        elif compression == "bz2":
            content = bz2.BZ2Decompressor().decompress(data, size)
        elif compression == "lz4":
            content = lz4.frame.LZ4FrameDecompressor().decompress(data, size)
        else:
            raise DamagedBagError(f"its compression {compression!r} is unknown")
    except (OSError, RuntimeError, EOFError, MemoryError) as error:
        raise DamagedBagError(f"{compression} cannot decompress it") from error
    return memoryview(content), len(content) == size


def parse_chunk(content: memoryview) -> tuple[Sequence[BagMessage], dict[int, BagConnection], str | None]:
    """Messages by time and connections of a chunk's content, and what was wrong with it, if anything."""
    if not memory.is_small(content):
        return _parse_one_by_one(content)
    messages: list[BagMessage] = []
    connections: dict[int, BagConnection] = {}
    position, end, problem = 0, len(content), None
    op = conn = time = 0  # where the last message had its fields: most often the next has them there, too
    try:
        while position < end:
            start, stop, data_start, position = _extent(content, position, end)
            head, data = bytes(content[start:stop]), content[data_start:position]
            if (
                len(head) == _MESSAGE_HEADER
                and head[op : op + 8] == _OP_FIELD
                and head[conn : conn + 9] == _CONN_FIELD
                and head[time : time + 9] == _TIME_FIELD
            ):
                seconds, nanoseconds = _TIME.unpack_from(head, time + 9)
                messages.append(BagMessage(seconds * 10**9 + nanoseconds, _UINT32.unpack_from(head, conn + 9)[0], data))
                continue
            header = parse_header(memoryview(head))
            if operation(header) == MESSAGE:
                messages.append(BagMessage(time_ns(field(header, b"time")), uint32(field(header, b"conn")), data))
                op, conn, time = (max(head.find(name), 0) for name in (_OP_FIELD, _CONN_FIELD, _TIME_FIELD))
            elif operation(header) == CONNECTION:
                key, connection = parse_connection(header, data)
                connections[key] = connection
    except DamagedBagError as error:
        problem = str(error)
    messages.sort(key=lambda message: message.time_ns)
    return messages, connections, problem


def _parse_one_by_one(
    content: memoryview,
) -> tuple[Sequence[BagMessage], dict[int, BagConnection], str | None]:
    """The same of a large chunk, which may hold millions: only where they lie and their times are kept."""
    starts, times, keys = array("q"), array("q"), array("q")
    connections: dict[int, BagConnection] = {}
    position, end, problem = 0, len(content), None
    try:
        while position < end:
            begin = position
            start, stop, data_start, position = _extent(content, position, end)
            header = parse_header(content[start:stop])
            if operation(header) == MESSAGE:
                times.append(time_ns(field(header, b"time")))
                keys.append(uint32(field(header, b"conn")))
                starts.append(begin)
            elif operation(header) == CONNECTION:
                key, connection = parse_connection(header, content[data_start:position])
                connections[key] = connection
    except DamagedBagError as error:
        problem = str(error)

    def message(number: int) -> BagMessage:
        _, _, data_start, stop = _extent(content, starts[number], end)
        return BagMessage(times[number], keys[number], content[data_start:stop])

    order = array("q", np.argsort(np.asarray(times), kind="stable").astype("<i8").tobytes())
    return memory.Lazily(order, message), connections, problem


def _extent(content: memoryview, position: int, end: int) -> tuple[int, int, int, int]:
    """Start and end of the header and of the data of the record at a position.

    Raises:
        DamagedBagError: it is cut.
    """
    start = position + 4
    if start <= end:
        stop = start + _UINT32.unpack_from(content, position)[0]
        if stop + 4 <= end:
            last = stop + 4 + _UINT32.unpack_from(content, stop)[0]
            if last <= end:
                return start, stop, stop + 4, last
    raise DamagedBagError("a record in it is cut")


def index_counts(header: Header, data: bytes) -> Counter[int]:
    """Messages by connection that an index record declares for the chunk before it."""
    if len(data) % _INDEX_ENTRY.size:
        raise DamagedBagError("an index record has the wrong length")
    return Counter({uint32(field(header, b"conn")): len(data) // _INDEX_ENTRY.size})
