"""ROS 1 bags: every message arrives as ROS 2, and what is damaged is told."""

import struct
from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.sources import Log, find_source
from mcap_landmarks.sources.rosbag1 import Rosbag1Config
from mcap_landmarks.stage import RawMessage
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import get_types_from_msg

from tests.sources.bags import HUMBLE, ROS1, START_NS, scan, text, times, write_ros1

SOURCE = find_source("rosbag1")


def read(path: Path) -> tuple[list[RawMessage], Log]:
    with SOURCE.open(path, Rosbag1Config()) as logs:
        (log,) = logs
        (part,) = log.parts
        assert not isinstance(part, Path)
        return list(part.messages()), part


@pytest.mark.parametrize("compression", [None, "bz2", "lz4"])
def test_messages_become_humbles(tmp_path: Path, compression: str | None) -> None:
    messages, log = read(write_ros1(tmp_path / "a.bag", compression=compression))
    assert [entry.count for entry in log.channels] == [40, 40]
    assert not log.losses
    scans = [raw for raw in messages if raw.connection.topic == "/scan"]
    assert [raw.log_time_ns for raw in scans] == times(40)
    assert [raw.publish_time_ns for raw in scans] == times(40)
    for raw in scans:
        wanted = HUMBLE.serialize_cdr(scan(HUMBLE, raw.log_time_ns), "sensor_msgs/msg/LaserScan")
        assert bytes(raw.data) == bytes(wanted)
    words = [
        HUMBLE.deserialize_cdr(raw.data, "std_msgs/msg/String") for raw in messages if raw.connection.topic == "/talk"
    ]
    assert words == [text(HUMBLE, f"word {i}") for i in range(40)]


def test_latched_topics_stay_so(tmp_path: Path) -> None:
    _, log = read(write_ros1(tmp_path / "a.bag"))
    quality = {entry.connection.topic: entry.connection.metadata["offered_qos_profiles"] for entry in log.channels}
    assert "durability: 1" in quality["/talk"]
    assert "durability: 2" in quality["/scan"]


def test_overlapping_chunks_are_merged_by_time(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    writer = Writer(path)
    writer.chunk_threshold = 200
    order = [5, 1, 9, 3, 0, 8, 2, 7, 4, 6] * 6
    with writer:
        talk = writer.add_connection("/talk", "std_msgs/msg/String", typestore=ROS1)
        for i, second in enumerate(order):
            data = ROS1.serialize_ros1(text(ROS1, str(i)), "std_msgs/msg/String")
            writer.write(talk, START_NS + second * 10**9 + i, data)
    messages, _ = read(path)
    stamps = [raw.log_time_ns for raw in messages]
    assert stamps == sorted(START_NS + second * 10**9 + i for i, second in enumerate(order))


def without_index(path: Path) -> int:
    """Take a bag's index away, as a recorder that was killed leaves it; where the index was."""
    data = bytearray(path.read_bytes())
    place = data.index(b"index_pos=") + 10
    (index,) = struct.unpack_from("<Q", data, place)
    struct.pack_into("<Q", data, place, 0)
    path.write_bytes(data[:index])
    return int(index)


@pytest.mark.parametrize("compression", [None, "bz2", "lz4"])
def test_a_bag_without_index_gives_everything_and_says_so(tmp_path: Path, compression: str | None) -> None:
    path = write_ros1(tmp_path / "a.bag", compression=compression)
    whole, _ = read(path)
    without_index(path)
    messages, log = read(path)
    assert [bytes(raw.data) for raw in messages] == [bytes(raw.data) for raw in whole]
    assert "never finished" in log.losses[0]


@pytest.mark.parametrize("share", [0.97, 0.7, 0.4])
@pytest.mark.parametrize("indexed", [True, False])
def test_a_cut_bag_gives_what_lies_before_the_cut(tmp_path: Path, share: float, indexed: bool) -> None:
    path = write_ros1(tmp_path / "a.bag")
    whole, _ = read(path)
    end = path.stat().st_size if indexed else without_index(path)
    cut = 4117 + int((end - 4117) * share)
    path.write_bytes(path.read_bytes()[:cut])
    messages, log = read(path)
    key = [(raw.log_time_ns, bytes(raw.data)) for raw in messages]
    assert set(key) <= {(raw.log_time_ns, bytes(raw.data)) for raw in whole}
    assert len(key) >= len(whole) * (share - 0.25)
    assert log.losses
    if share < 0.9:  # the messages before the cut lie before it in time, too
        assert key == [(raw.log_time_ns, bytes(raw.data)) for raw in whole][: len(key)]


def test_a_damaged_chunk_is_lost_alone(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag", compression="bz2")
    with Reader(path) as reader:
        chunk = sorted(reader.chunks.values(), key=lambda chunk: chunk.datapos)[1]
        info = sorted(reader.chunk_infos, key=lambda info: info.pos)[1]
    data = bytearray(path.read_bytes())
    data[chunk.datapos + 30] ^= 0xFF
    path.write_bytes(data)
    messages, log = read(path)
    missing = sum(info.connection_counts.values())
    assert len(messages) == 80 - missing
    assert sum(entry.count for entry in log.channels) == 80
    assert f"lacks {missing} of {missing} messages" in log.losses[0]


def test_a_message_that_does_not_fit_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with Writer(path) as writer:
        talk = writer.add_connection("/talk", "std_msgs/msg/String", typestore=ROS1)
        for data in (b"\x02\x00\x00\x00ok", b"\xff\x00\x00\x00short", b"\x02\x00\x00\x00ok!"):
            writer.write(talk, START_NS, data)
    messages, log = read(path)
    assert [bytes(raw.data)[4:] for raw in messages] == [b"\x03\x00\x00\x00ok\x00"]
    assert len(log.losses) == 1
    assert "/talk: 9 bytes are not a std_msgs/String" in log.losses[0]


def test_a_definition_that_cannot_be_understood_stops_only_its_topic(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with Writer(path) as writer:
        odd = writer.add_connection("/odd", "odd_msgs/msg/Odd", msgdef="Missing thing\n", md5sum="0" * 32)
        talk = writer.add_connection("/talk", "std_msgs/msg/String", typestore=ROS1)
        writer.write(odd, START_NS, b"")
        writer.write(talk, START_NS, b"\x02\x00\x00\x00ok")
    with SOURCE.open(path, Rosbag1Config()) as logs:
        log = logs[0].parts[0]
        assert [raw.connection.topic for raw in log.messages()] == ["/talk"]
        (odd_one,) = log.left_out
        assert (odd_one.topic, odd_one.message_type, odd_one.messages) == ("/odd", "odd_msgs/msg/Odd", 1)
        assert not log.losses


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"#ROSBAG V1.2\n", "rosbag migrate"),
        (b"something else", "not a ROS 1 bag"),
        (b"#ROSBAG V2.0\n", "cannot be read"),
        (b"#ROSBAG V2.0\n" + b"\xff" * 40, "claims"),
    ],
)
def test_what_is_no_bag_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words), SOURCE.open(path, Rosbag1Config()):
        pass


def test_an_encrypted_bag_is_refused(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag")
    data = path.read_bytes()
    header_length = struct.unpack_from("<I", data, 13)[0]
    field = b"\x0d\x00\x00\x00encryptor=aes"
    changed = data[:13] + struct.pack("<I", header_length + len(field)) + data[17 : 17 + header_length] + field
    path.write_bytes(changed + data[17 + header_length :])
    with pytest.raises(RecordingError, match="encrypted"), SOURCE.open(path, Rosbag1Config()):
        pass


def test_types_of_the_test_bags_are_what_they_seem() -> None:
    """The definitions that rosbags embeds are ROS 1's: a header has `seq`."""
    definition, _ = ROS1.generate_msgdef("sensor_msgs/msg/LaserScan", ros_version=1)
    assert "uint32 seq" in definition
    assert get_types_from_msg(definition, "sensor_msgs/msg/LaserScan")
