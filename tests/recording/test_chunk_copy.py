"""Chunks go from recording to recording as they are, where every record in them would be the same there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection, Stamped

SECOND = 10**9


def write_log(path: Path) -> None:
    """Odometry and images in chunks of their own, as we write them: three of each, of five seconds."""
    with create_recording(path) as writer:
        for i in range(130):
            now = i * SECOND // 10
            writer.add(Stamped(ODOMETRY, now, Odometry.planar(now, ("odom", "base"), (i, 0, 0), np.eye(3))))
            writer.add(Stamped(CAMERA_IMAGE, now, CompressedImage(now, "camera", "jpeg", bytes(1000))))


def write_foreign_log(path: Path, topics: Sequence[str] = ("/a", "/b")) -> None:
    """As other recorders write: channels and schemas within the chunks, several topics in each, ids from 3 on."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, compression=CompressionType.LZ4)
        writer.start("ros2", "other")
        schema = writer.register_schema("std_msgs/msg/UInt8", "ros2msg", b"uint8 data")
        for _ in range(2):
            writer.register_channel("/unused", "cdr", schema, {"offered_qos_profiles": ""})
        ids = [writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": ""}) for topic in topics]
        for i in range(300):
            writer.add_message(ids[i % len(ids)], i * SECOND, bytes([0, 1, 0, 0, i % 256]), i * SECOND + 5, i)
        writer.finish()


@dataclass
class Copied:
    """What a copy was made of."""

    chunks: int
    messages: int


def copy(source: Path, target: Path, topics: Sequence[str] | None = None, start_ns: int | None = None) -> Copied:
    copied = Copied(0, 0)
    with open_recording(source) as recording, create_recording(target) as writer:
        wanted = [c.connection for c in recording.channels if topics is None or c.connection.topic in topics]
        kept = [connection for connection in wanted if writer.keep(connection, *recording.ids(connection))]
        for piece in recording.pieces(wanted, kept, writer.declared(), start_ns):
            if isinstance(piece, WholeChunk):
                writer.copy(piece)
                copied.chunks += 1
            else:
                writer.write(piece)
                copied.messages += 1
    return copied


def messages(path: Path) -> list[tuple[object, ...]]:
    """All that a reader of another tool finds, having checked every CRC."""
    with path.open("rb") as stream:
        return [
            (channel.topic, channel.id, message.log_time, message.publish_time, message.sequence, message.data)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages()
        ]


@pytest.mark.parametrize("write", [write_log, write_foreign_log], ids=["ours", "foreign"])
def test_everything_is_copied_as_it_is(tmp_path: Path, write: object) -> None:
    assert callable(write)
    write(tmp_path / "a.mcap")
    copied = copy(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert copied.chunks >= 6
    assert copied.messages == 0
    assert messages(tmp_path / "b.mcap") == messages(tmp_path / "a.mcap")
    with open_recording(tmp_path / "a.mcap") as before, open_recording(tmp_path / "b.mcap") as after:
        assert after.fingerprint() == before.fingerprint()
        assert [entry.count for entry in after.channels] == [entry.count for entry in before.channels]
        assert after.losses == []


def test_what_a_cut_goes_through_is_written_anew(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    copied = copy(tmp_path / "a.mcap", tmp_path / "b.mcap", start_ns=7 * SECOND)
    assert copied.chunks == 2
    wanted = [message for message in messages(tmp_path / "a.mcap") if int(str(message[2])) >= 7 * SECOND]
    assert sorted(map(str, messages(tmp_path / "b.mcap"))) == sorted(map(str, wanted))


def test_chunks_of_one_wanted_topic_are_copied(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    assert copy(tmp_path / "a.mcap", tmp_path / "b.mcap", ["/odom"]) == Copied(3, 0)


def test_mixed_chunks_are_written_anew(tmp_path: Path) -> None:
    write_foreign_log(tmp_path / "a.mcap")
    assert copy(tmp_path / "a.mcap", tmp_path / "b.mcap", ["/b"]) == Copied(0, 150)
    assert messages(tmp_path / "b.mcap") == [m for m in messages(tmp_path / "a.mcap") if m[0] == "/b"]


def test_chunks_whose_channels_became_others_are_written_anew(tmp_path: Path) -> None:
    write_foreign_log(tmp_path / "a.mcap", ["/a"])
    with open_recording(tmp_path / "a.mcap") as recording, create_recording(tmp_path / "b.mcap") as writer:
        old = next(entry.connection for entry in recording.channels if entry.count)
        new = Connection("/new", old.message_type, old.schema, metadata=old.metadata)
        assert writer.keep(new, *recording.ids(old))
        pieces = list(recording.pieces([old], [old], writer.declared()))
    kinds = [isinstance(piece, WholeChunk) for piece in pieces]
    assert kinds.count(False) > 0, "the chunk that holds the channel's record"
    assert not kinds[0]


def test_ids_that_are_taken_are_not_kept(tmp_path: Path) -> None:
    with create_recording(tmp_path / "a.mcap") as writer:
        first = Connection("/a", "std_msgs/msg/UInt8", b"uint8 data")
        assert writer.keep(first, 7, 3)
        assert not writer.keep(Connection("/b", "std_msgs/msg/UInt8", b"uint8 data"), 7, 3)
        assert not writer.keep(Connection("/b", "std_msgs/msg/UInt16", b"uint16 data"), 8, 3)
        writer.declare(Connection("/c", "std_msgs/msg/UInt16", b"uint16 data"))
    with (tmp_path / "a.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {channel.topic: (channel.id, channel.schema_id) for channel in summary.channels.values()} == {
        "/a": (7, 3),
        "/c": (8, 4),
    }


def test_what_is_damaged_is_never_copied(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[data.index(bytes(900))] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    with open_recording(tmp_path / "a.mcap") as recording, create_recording(tmp_path / "b.mcap") as writer:
        every = [entry.connection for entry in recording.channels]
        kept = [connection for connection in every if writer.keep(connection, *recording.ids(connection))]
        pieces = list(recording.pieces(every, kept, writer.declared()))
        assert all(isinstance(piece, WholeChunk) for piece in pieces)
        assert len(pieces) == 5
        assert len(recording.losses) == 1


def test_a_message_index_that_is_wrong_is_not_copied(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    offset = next(iter(summary.chunk_indexes[0].message_index_offsets.values()))
    data[offset + 15 + 16 + 8] ^= 1  # the second message's place
    (tmp_path / "a.mcap").write_bytes(data)
    copied = copy(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert copied.chunks == 5
    assert copied.messages == 51


def test_messages_of_a_channel_keep_their_order(tmp_path: Path) -> None:
    """Those of one time, at the end of a chunk that is written anew and at the start of one that is copied."""
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, compression=CompressionType.NONE)
        writer.start("ros2", "other")
        schema = writer.register_schema("std_msgs/msg/UInt8", "ros2msg", b"uint8 data")
        channel = writer.register_channel("/a", "cdr", schema, {"offered_qos_profiles": ""})
        for i in range(200):
            writer.add_message(channel, i // 50, bytes([0, 1, 0, 0, i]), i // 50, i)
        writer.finish()
    copied = copy(tmp_path / "a.mcap", tmp_path / "b.mcap", start_ns=1)
    assert copied.chunks > 0
    assert copied.messages > 0
    payloads = [message[5] for message in messages(tmp_path / "b.mcap")]
    wanted = [message[5] for message in messages(tmp_path / "a.mcap")][50:]
    assert payloads == wanted
