"""Small files that would take gigabytes if what they claim were believed, each made in a few lines."""

import bz2
import sqlite3
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Footer, Header, Schema
from mcap_landmarks.messages.typestore import definition

MAGIC = b"\x89MCAP0\r\n"
HUGE = 1 << 29
"""So many bytes are claimed, or really come, wherever nothing smaller does."""


def zeros(size: int) -> bytes:
    """A zstd frame of so many zeros that says its size."""
    stream = zstandard.ZstdCompressor().compressobj(size=size)
    piece = bytes(1 << 20)
    return b"".join(stream.compress(piece) for _ in range(size >> 20)) + stream.flush()


def zeros_of_unknown_size(size: int) -> bytes:
    """The same without the size."""
    stream = zstandard.ZstdCompressor().compressobj()
    return b"".join(stream.compress(bytes(1 << 20)) for _ in range(size >> 20)) + stream.flush()


def lz4_zeros(size: int) -> bytes:
    """An lz4 frame of so many zeros."""
    with lz4.frame.LZ4FrameCompressor() as stream:
        parts = [stream.begin(), *(stream.compress(bytes(1 << 20)) for _ in range(size >> 20)), stream.flush()]
    return b"".join(parts)


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _chunk(size: int, compression: bytes, data: bytes) -> bytes:
    head = struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", len(compression)) + compression
    return _record(6, head + struct.pack("<Q", len(data)) + data)


def _mcap(path: Path, chunk: bytes, text: str = "string data", ros_type: str = "std_msgs/msg/String") -> Path:
    builder = RecordBuilder()
    Header("ros2", "").write(builder)
    Schema(id=1, data=text.encode(), encoding="ros2msg", name=ros_type).write(builder)
    Channel(id=1, topic="/talk", message_encoding="cdr", metadata={}, schema_id=1).write(builder)
    head = bytes(builder.end())  # type: ignore[no-untyped-call]
    Footer(0, 0, 0).write(builder)
    path.write_bytes(MAGIC + head + chunk + bytes(builder.end()) + MAGIC)  # type: ignore[no-untyped-call]
    return path


def cut_zstd_chunk(folder: Path) -> Path:
    """A chunk that the end of the file cuts."""
    whole = _mcap(folder / "cut.mcap", b"").read_bytes()[:-37]
    (folder / "cut.mcap").write_bytes(whole + _chunk(HUGE, b"zstd", zeros_of_unknown_size(HUGE))[:-100])
    return folder / "cut.mcap"


def zstd_chunk(folder: Path) -> Path:
    """A chunk that really unpacks to what it claims."""
    return _mcap(folder / "zstd.mcap", _chunk(HUGE, b"zstd", zeros(HUGE)))


def lz4_chunk(folder: Path) -> Path:
    """A chunk that claims to be small and is not."""
    return _mcap(folder / "lz4.mcap", _chunk(1000, b"lz4", lz4_zeros(HUGE)))


def tiny_records(folder: Path) -> Path:
    """A chunk of millions of records without content."""
    content = struct.pack("<BQ", 0x7F, 0) * 250_000
    return _mcap(folder / "tiny.mcap", _chunk(len(content), b"zstd", zstandard.ZstdCompressor(3).compress(content)))


def tiny_messages(folder: Path) -> Path:
    """A chunk of millions of messages without content."""
    content = (struct.pack("<BQ", 5, 22) + struct.pack("<HIQQ", 1, 0, 1, 1)) * 100_000
    return _mcap(folder / "messages.mcap", _chunk(len(content), b"zstd", zstandard.ZstdCompressor(3).compress(content)))


def huge_lengths(folder: Path) -> Path:
    """Records that claim more than any memory."""
    return _mcap(folder / "lengths.mcap", struct.pack("<BQ", 6, 2**63) + struct.pack("<BQ", 8, 2**40) + bytes(100))


def recursive_schema(folder: Path) -> Path:
    """A type that holds itself."""
    return _mcap(folder / "recursive.mcap", b"", "odd/Self[] inner\n", "odd/msg/Self")


def growing_text() -> str:
    """A definition whose types hold each other twice, 40 levels deep."""
    parts = "".join(f"{'=' * 80}\nMSG: odd/T{i}\nodd/T{i + 1} a\nodd/T{i + 1} b\n" for i in range(1, 40))
    return f"odd/T1 a\nodd/T1 b\n{parts}{'=' * 80}\nMSG: odd/T40\nuint8 x\n"


def growing_schema(folder: Path) -> Path:
    """A type of 2**40 fields, with a message."""
    content = struct.pack("<BQ", 5, 26) + struct.pack("<HIQQ", 1, 0, 1, 1) + b"\0\1\0\0"
    return _mcap(folder / "growing.mcap", _chunk(len(content), b"", content), growing_text(), "odd/msg/T0")


def _fields(**fields: bytes) -> bytes:
    return b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items())


def _bag_record(data: bytes, **fields: bytes) -> bytes:
    header = _fields(**fields)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def _bag(path: Path, chunk: bytes, ros_type: str = "std_msgs/String", text: str = "string data") -> Path:
    about = _fields(topic=b"/talk", type=ros_type.encode(), md5sum=b"*", message_definition=text.encode())
    head = _bag_record(b" " * 4027, op=b"\3", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
    connection = _bag_record(about, op=b"\7", conn=bytes(4), topic=b"/talk")
    path.write_bytes(b"#ROSBAG V2.0\n" + head + connection + chunk)
    return path


def bz2_bag(folder: Path) -> Path:
    """A bag's chunk that claims to unpack to a gigabyte."""
    data = bz2.compress(bytes(1 << 20))
    return _bag(folder / "bz2.bag", _bag_record(data, op=b"\5", compression=b"bz2", size=struct.pack("<I", HUGE)))


def lz4_bag(folder: Path) -> Path:
    """The same with lz4."""
    data = lz4_zeros(HUGE)
    return _bag(folder / "lz4.bag", _bag_record(data, op=b"\5", compression=b"lz4", size=struct.pack("<I", HUGE)))


def tiny_bag(folder: Path) -> Path:
    """A bag's chunk of millions of messages without content."""
    content = _bag_record(b"", op=b"\2", conn=bytes(4), time=bytes(8)) * 40_000
    data = lz4.frame.compress(content)
    chunk = _bag_record(data, op=b"\5", compression=b"lz4", size=struct.pack("<I", len(content)))
    return _bag(folder / "tiny.bag", chunk)


def growing_bag(folder: Path) -> Path:
    """A bag whose definition grows exponentially."""
    message = _bag_record(b"", op=b"\2", conn=bytes(4), time=bytes(8))
    chunk = _bag_record(message, op=b"\5", compression=b"none", size=struct.pack("<I", len(message)))
    return _bag(folder / "growing.bag", chunk, "odd/T0", growing_text())


def db3_message(folder: Path, size: int = HUGE) -> Path:
    """A db3 with messages that unpack to so many bytes each."""
    path = folder / "message.db3"
    with sqlite3.connect(path) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,"
            " offered_qos_profiles TEXT);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT,"
            " encoded_message_definition TEXT, type_description_hash TEXT);"
        )
        database.execute("INSERT INTO topics VALUES (1, '/talk', 'std_msgs/msg/String', 'cdr', '')")
        text = definition("std_msgs/msg/String")
        database.execute("INSERT INTO message_definitions VALUES (1, 'std_msgs/msg/String', 'ros2msg', ?, '')", (text,))
        rows = [(zeros(size),), (zeros_of_unknown_size(size),)]
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, 5, ?)", rows)
    database.close()
    return path


def zipped_tables(folder: Path) -> Path:
    """An MRCLAM zip whose tables unpack to a gigabyte."""
    with zipfile.ZipFile(folder / "tables.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Barcodes.dat", "1 5\n")
        with archive.open("Robot1_Odometry.dat", "w") as stream:
            for _ in range(100):
                stream.write(b"1 2 3\n" * 200_000)
    return folder / "tables.zip"


def many_aliases(folder: Path) -> Path:
    """A bag whose metadata.yaml has a list that doubles with each line."""
    bag = folder / "aliases"
    bag.mkdir()
    lines = ["rosbag2_bagfile_information:", "  a0: &a0 [x, x]"]
    lines += [f"  a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, 40)]
    lines += ["  ros_distro: *a39", "  relative_file_paths: [*a39]"]
    (bag / "metadata.yaml").write_text("\n".join(lines))
    db3_message(bag, 1 << 20)
    return bag


def png(width: int, height: int, rows: int) -> bytes:
    """A black PNG that says a size, and has so many rows."""
    data = zlib.compress(bytes(width + 1) * rows)

    def part(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    head = part(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + part(b"IDAT", data) + part(b"IEND", b"")


LOGS: tuple[Callable[[Path], Path], ...] = (
    cut_zstd_chunk,
    zstd_chunk,
    lz4_chunk,
    tiny_records,
    tiny_messages,
    huge_lengths,
    recursive_schema,
    growing_schema,
    bz2_bag,
    lz4_bag,
    tiny_bag,
    growing_bag,
    db3_message,
    zipped_tables,
    many_aliases,
)
