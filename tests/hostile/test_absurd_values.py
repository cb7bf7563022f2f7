"""Stamps, counts and places that cannot be, in logs that are sound otherwise: in bounded time, and with a code."""

import re
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer
from mcap_landmarks.messages.typestore import definition

from tests.cli.calls import call
from tests.hostile import inputs
from tests.recording import damages
from tests.sources import bags

NONE = b"\xff" * 8


def _altered(opcode: int, offset: int, new: bytes) -> Callable[[Path], Path]:
    """A recording with other bytes at an offset of the first record of a kind."""

    def make(folder: Path) -> Path:
        data, _ = damages.write(crcs=False)
        record = damages.of_kind(data, opcode)[0]
        (folder / "log.mcap").write_bytes(damages.put(data, record.start + 9 + offset, new))
        return folder / "log.mcap"

    return make


def _stamped(*stamps: int) -> Callable[[Path], Path]:
    """A recording with messages of these log times, and attachments that are named like places elsewhere."""

    def make(folder: Path) -> Path:
        with (folder / "log.mcap").open("wb") as stream:
            writer = Writer(stream)
            writer.start("ros2", "by hand")
            schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
            channel = writer.register_channel("/talk", "cdr", schema)
            writer.add_attachment(1, 1, "../escaped.txt", "text/plain", b"x")
            writer.add_attachment(1, 1, str(folder.parent / "escaped.txt"), "text/plain", b"x")
            for stamp in stamps:
                writer.add_message(channel, stamp, b"\0\1\0\0\1\0\0\0\0", stamp)
            writer.finish()
        return folder / "log.mcap"

    return make


def _db3(stamp: object) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = bags.write_plain_db3(folder / "log.db3", 3)
        with sqlite3.connect(path) as database:
            database.execute("UPDATE messages SET timestamp = ? WHERE id = 1", (stamp,))
        database.close()
        return path

    return make


def _table(change: str) -> Callable[[Path], Path]:
    """A db3 whose tables are other ones than they should be."""

    def make(folder: Path) -> Path:
        path = bags.write_plain_db3(folder / "log.db3", 3)
        with sqlite3.connect(path) as database:
            database.executescript(change)
        database.close()
        return path

    return make


def _bag(field: bytes, new: bytes) -> Callable[[Path], Path]:
    """A bag with other bytes wherever a field is."""

    def make(folder: Path) -> Path:
        data = bags.write_ros1(folder / "log.bag", 4).read_bytes()
        for found in re.finditer(re.escape(field), data):
            data = damages.put(data, found.end(), new)
        (folder / "log.bag").write_bytes(data)
        return folder / "log.bag"

    return make


LOGS = {
    "counts": _altered(damages.STATISTICS, 0, NONE),
    "numbers of schemas and channels": _altered(damages.STATISTICS, 8, NONE + NONE[:6]),
    "length of a chunk": _altered(damages.CHUNK_INDEX, 24, NONE),
    "map of a chunk's indexes": _altered(damages.CHUNK_INDEX, 32, NONE[:4]),
    "entries of a message index": _altered(damages.MESSAGE_INDEX, 2, NONE[:4]),
    "place in a message index": _altered(damages.MESSAGE_INDEX, 14, NONE),
    "keys of a metadata record": _altered(damages.METADATA, 9, NONE[:3]),
    "times near 2**64": _stamped(0, 2**63, 2**64 - 1),
    "a negative time": _db3(-5),
    "a time that is a word": _db3("soon"),
    "a time that is no time": _db3(1e300),
    "topics without ids": _table("ALTER TABLE topics RENAME COLUMN id TO number"),
    "topics without names": _table("ALTER TABLE topics RENAME COLUMN name TO title"),
    "topics without types": _table("UPDATE topics SET type = NULL"),
    "topics named by bytes": _table("UPDATE topics SET name = x'ff00'"),
    "messages without times": _table("ALTER TABLE messages RENAME COLUMN timestamp TO moment"),
    "messages of no topic": _table("UPDATE messages SET topic_id = 'x'"),
    "payloads that are words": _table("UPDATE messages SET data = 'words'"),
    "ids that are words": _table(
        "DROP TABLE topics; CREATE TABLE topics(id, name, type, serialization_format,"
        " offered_qos_profiles); INSERT INTO topics VALUES ('x', '/talk', 'std_msgs/msg/String', 'cdr', '')"
    ),
    "seconds of 2**32": _bag(b"time=", NONE[:4]),
    "one chunk for all": _bag(b"chunk_pos=", struct.pack("<Q", 13)),
    "index in front": _bag(b"index_pos=", struct.pack("<Q", 13)),
    "index far away": _bag(b"index_pos=", NONE),
    "count of chunks": _bag(b"chunk_count=", NONE[:4]),
}


@pytest.mark.parametrize("name", LOGS)
def test_absurd_values_end_no_verb_without_words(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "deep"
    folder.mkdir()
    log = LOGS[name](folder)
    assert call("info", "--check", log) in {0, 1, 3}
    assert call("convert", log, "-o", folder / "out.mcap") in {0, 1, 3}
    assert call("recover", log, "-o", folder / "back.mcap") in {0, 1, 3}
    assert [path.name for path in tmp_path.rglob("escaped*")] == []


@pytest.mark.parametrize("topic", ["/scan", "/odom"])
def test_sensors_may_tell_times_that_cannot_be(topic: str, tmp_path: Path) -> None:
    """Of log times near 2**64 the stamps of sensors are looked at like those of others."""
    ros_type = {"/scan": "sensor_msgs/msg/LaserScan", "/odom": "nav_msgs/msg/Odometry"}[topic]
    with (tmp_path / "log.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "by hand")
        schema = writer.register_schema(ros_type, "ros2msg", definition(ros_type).encode())
        channel = writer.register_channel(topic, "cdr", schema)
        for stamp in (1, 2**63, 2**64 - 1):
            data = bags.HUMBLE.serialize_cdr(bags.scan(bags.HUMBLE, 10**9), ros_type) if topic == "/scan" else b""
            writer.add_message(channel, stamp, bytes(data) or b"\0\1\0\0" + bytes(716), stamp)
        writer.finish()
    assert call("info", "--check", tmp_path / "log.mcap") in {0, 3}


def test_a_type_that_holds_itself_is_compared(tmp_path: Path) -> None:
    log = inputs.recursive_schema(tmp_path)
    assert call("diff", log, log) in {0, 1, 3}
