"""Conversion: every message arrives, in time order, once; what cannot is told, and nothing is half written."""

import json
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import Writer as McapWriter
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.topic_selection import Selection
from rosbags.highlevel import AnyReader

from tests.runs.conversion import doctor, one, run, stored
from tests.sources.bags import (
    HUMBLE,
    ROS1,
    START_NS,
    scan,
    times,
    write_mrclam,
    write_plain_db3,
    write_ros1,
    write_ros2,
)

BAGS = (
    "legtracker_demo.bag",
    "legtracker_positive_2_extracted.bag",
    "rosbagjs_example.bag",
    "rosbagjs_example_bz2.bag",
    "rosbagjs_example_lz4.bag",
    "rosbags_rs_sqlite3",
    "rosbags_rs_mcap",
    "rosbag2_split_sqlite3",
    "rosbag2_split_mcap",
    "topics_and_services.mcap",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in BAGS if not name.endswith(".bag")])
def test_ros2_bags_arrive_whole(name: str, tmp_path: Path, shared_data: Path) -> None:
    source, target = shared_data / "bags" / name, tmp_path / "out.mcap"
    done = one(source, target)
    wanted = stored(source)
    assert stored(target) == wanted
    assert done.topics.total() == done.declared == wanted.total()
    assert (done.lost, done.losses) == (0, [])
    assert doctor(target) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in BAGS if name.endswith(".bag")])
def test_ros1_bags_arrive_whole(name: str, tmp_path: Path, shared_data: Path) -> None:
    """Counts, and field by field the values of every message, against rosbags' reading of the bag."""
    source, target = shared_data / "bags" / name, tmp_path / "out.mcap"
    done = one(source, target)
    with AnyReader([source]) as old, AnyReader([target]) as new:
        wanted = {(c.topic, time, i): (c, data) for c, time, data, i in numbered(old)}
        assert done.topics.total() == done.declared == len(wanted) == new.message_count
        assert done.topics == {topic: info.msgcount for topic, info in old.topics.items()}
        for c, time, data, i in numbered(new):
            before, raw = wanted.pop((c.topic, time, i))
            was, now = old.deserialize(raw, before.msgtype), new.deserialize(data, c.msgtype)
            assert fields(was).items() <= fields(now).items()
    assert not wanted
    assert (done.lost, done.losses) == (0, [])
    assert doctor(target) == []


def numbered(reader: AnyReader) -> list[tuple]:
    """Messages with their number among those of equal topic and time."""
    seen: Counter[tuple[str, int]] = Counter()
    rows = []
    for connection, time, data in reader.messages():
        rows.append((connection, time, data, seen[connection.topic, time]))
        seen[connection.topic, time] += 1
    return rows


def fields(message: object, prefix: str = "") -> dict[str, object]:
    """Every number and text of a message by its path, but `seq`."""
    flat: dict[str, object] = {}
    for name, value in vars(message).items():
        key = f"{prefix}{name.lower()}"
        if hasattr(value, "__msgtype__"):
            flat |= fields(value, f"{key}.")
        elif isinstance(value, list) and value and hasattr(value[0], "__msgtype__"):
            for i, item in enumerate(value):
                flat |= fields(item, f"{key}.{i}.")
        elif name not in {"seq", "__msgtype__"}:
            flat[key] = value.tobytes() if hasattr(value, "tobytes") else value
    return {key: value for key, value in flat.items() if value == value}  # noqa: PLR0124 - leaves NaN out


def test_publish_time_sequence_and_metadata_are_kept(tmp_path: Path) -> None:
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"
    text = HUMBLE.generate_msgdef("std_msgs/msg/String", ros_version=2)[0].encode()
    with source.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", text)
        channel = writer.register_channel("/talk", "cdr", schema, {"offered_qos_profiles": "", "mine": "kept"})
        for i in range(5):
            writer.add_message(channel, 1000 + i, b"\0\1\0\0\1\0\0\0\0", publish_time=900 + i, sequence=77 + i)
        writer.add_metadata("rosbag2", {"serialized_metadata": "version: 9"})
        writer.add_metadata("site", {"hall": "4"})
        writer.add_attachment(1, 1, "plan.txt", "text/plain", b"walls")
        writer.finish()
    one(source, target)
    with target.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        rows = [(message.log_time, message.publish_time, message.sequence) for _, _, message in reader.iter_messages()]
        assert rows == [(1000 + i, 900 + i, 77 + i) for i in range(5)]
        summary = reader.get_summary()
        assert summary is not None
        assert next(iter(summary.channels.values())).metadata == {"offered_qos_profiles": "", "mine": "kept"}
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert set(metadata) == {"site", "mcap-landmarks.run"}
        assert json.loads(metadata["mcap-landmarks.run"]["verb"]) == "convert"
        attachments: list[Attachment] = list(reader.iter_attachments())
        assert [(attachment.name, attachment.data) for attachment in attachments] == [("plan.txt", b"walls")]


def test_ros1_messages_in_mcap_become_ros2(tmp_path: Path) -> None:
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"
    name = "sensor_msgs/msg/LaserScan"
    with source.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros1")
        text = ROS1.generate_msgdef(name, ros_version=1)[0].encode()
        schema = writer.register_schema("sensor_msgs/LaserScan", "ros1msg", text)
        channel = writer.register_channel("/scan", "ros1", schema, {"latching": "1"})
        other = writer.register_channel("/json", "json", 0)
        writer.add_message(channel, START_NS, bytes(ROS1.serialize_ros1(scan(ROS1, START_NS), name)), START_NS)
        writer.add_message(other, START_NS, b"{}", START_NS)
        writer.finish()
    assert one(source, target, Selection(("/scan",))).topics == {"/scan": 1}
    wanted = bytes(HUMBLE.serialize_cdr(scan(HUMBLE, START_NS), name))
    assert stored(target) == {("/scan", START_NS, wanted): 1}


def test_a_ros1_definition_that_cannot_be_understood_stops_only_its_topic(tmp_path: Path) -> None:
    source = tmp_path / "in.mcap"
    with source.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros1")
        bad = writer.register_schema("odd_msgs/Odd", "ros1msg", b"Missing thing\n")
        good = writer.register_schema("std_msgs/String", "ros1msg", b"string data\n")
        writer.add_message(writer.register_channel("/odd", "ros1", bad), 1, b"", 1)
        writer.add_message(writer.register_channel("/talk", "ros1", good), 1, b"\x02\0\0\0ok", 1)
        writer.add_message(writer.register_channel("/short", "ros1", good), 1, b"\x09\0\0\0ok", 1)
        writer.finish()
    done = one(source, tmp_path / "out.mcap")
    assert [topic.told.partition(":")[0] for topic in done.left_out] == ["topic /odd (odd_msgs/Odd), 1 message"]
    assert (done.topics, done.declared, done.lost) == ({"/talk": 1, "/short": 0}, 3, 2)
    done = one(source, tmp_path / "out.mcap", Selection(("/talk", "/short")))
    assert done.topics == {"/talk": 1, "/short": 0}
    assert (done.declared, done.lost) == (2, 1)
    assert "in.mcap: /short: 6 bytes are not a std_msgs/String" in done.losses[0]


@pytest.mark.parametrize("mode", ["message", "file"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_compression_is_taken_off(storage: str, mode: str, tmp_path: Path) -> None:
    one(write_ros2(tmp_path / "plain", storage=storage), tmp_path / "plain.mcap")
    one(write_ros2(tmp_path / "packed", storage=storage, mode=mode), tmp_path / "packed.mcap")
    assert stored(tmp_path / "packed.mcap") == stored(tmp_path / "plain.mcap")


def test_parts_of_a_split_bag_become_one(tmp_path: Path, shared_data: Path) -> None:
    folder = shared_data / "bags" / "rosbag2_split_sqlite3"
    parts = sorted(folder.glob("*.db3"))
    done = one(parts[::-1], tmp_path / "out.mcap")
    assert done.topics.total() == 6074
    with open_recording(tmp_path / "out.mcap") as recording:
        assert len(recording.channels) == 8
    one(folder, tmp_path / "folder.mcap")
    assert stored(tmp_path / "out.mcap") == stored(tmp_path / "folder.mcap")


def test_several_logs_merge_into_one_file(tmp_path: Path) -> None:
    """A ROS 1 bag, a ROS 2 bag and a plain database of the same topic: one channel per type and quality."""
    sources = [write_ros1(tmp_path / "a.bag"), write_ros2(tmp_path / "b"), write_plain_db3(tmp_path / "c.db3")]
    done = one(sources, tmp_path / "out.mcap")
    assert done.topics == {"/scan": 40 + 20, "/talk": 40 + 20 + 20}
    with open_recording(tmp_path / "out.mcap") as recording:
        assert sorted(entry.connection.topic for entry in recording.channels) == ["/scan"] * 2 + ["/talk"] * 3
        stamps = [raw.log_time_ns for raw in recording.messages()]
    assert stamps == sorted(stamps)
    twice = one([sources[0], write_ros1(tmp_path / "d.bag")], tmp_path / "twice.mcap")
    assert twice.topics == {"/scan": 80, "/talk": 80}
    with open_recording(tmp_path / "twice.mcap") as recording:
        assert [entry.count for entry in recording.channels] == [80, 80]


def test_several_logs_go_into_a_folder(tmp_path: Path) -> None:
    sources = [write_ros1(tmp_path / "a.bag"), write_ros2(tmp_path / "b")]
    done = run(sources, tmp_path / "out").outputs
    assert [(entry.path.name, entry.topics.total()) for entry in done] == [("a.mcap", 80), ("b.mcap", 40)]
    (tmp_path / "other").mkdir()
    clash = [sources[0], write_ros1(tmp_path / "other" / "a.bag")]
    with pytest.raises(UsageError, match=r"another input also writes .*a\.mcap"):
        run(clash, tmp_path / "clash")
    assert not (tmp_path / "clash").exists()


def test_robots_go_into_a_folder(tmp_path: Path) -> None:
    source = write_mrclam(tmp_path / "set")
    done = run(source, tmp_path / "out").outputs
    assert [entry.path.name for entry in done] == ["robot1.mcap", "robot2.mcap"]
    assert done[0].dropped == {"Robot1_Measurement.dat: barcode of a robot": 5}
    assert doctor(done[0].path) == []
    with pytest.raises(UsageError, match="holds 2 logs; give -o a folder"):
        run(source, tmp_path / "out.mcap")
    with pytest.raises(UsageError, match="missing does not exist; create it first"):
        run(source, tmp_path / "missing" / "out")


def test_topics_and_times_choose(tmp_path: Path) -> None:
    source = write_ros2(tmp_path / "a", count=40)
    done = one(source, tmp_path / "out.mcap", Selection(("/t.lk", "/nothing"), times(40)[3], times(40)[9]))
    assert done.topics == {"/talk": 6}
    assert (done.declared, done.lost) == (6, 0)
    assert done.dropped == {"messages outside the time range": 34}
    with pytest.raises(UsageError, match=r"--topics matches none of /scan, /talk"):
        run(source, tmp_path / "none.mcap", Selection(("/tal",)))
    with pytest.raises(UsageError, match="not a regular expression"):
        run(source, tmp_path / "none.mcap", Selection(("(",)))
    with pytest.raises(RecordingError, match="no message lies in the time range"):
        run(source, tmp_path / "none.mcap", Selection(start_ns=5, end_ns=6))
    assert not (tmp_path / "none.mcap").exists()


def test_equal_inputs_give_equal_bytes(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag")
    (tmp_path / "elsewhere").mkdir()
    copy = (tmp_path / "elsewhere" / "b.bag").write_bytes(source.read_bytes())
    assert copy
    one(source, tmp_path / "a.mcap")
    one(tmp_path / "elsewhere" / "b.bag", tmp_path / "elsewhere" / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "elsewhere" / "b.mcap").read_bytes()
