"""Back to ROS 1: bags that rosbag plays, with the types and checksums that ROS 1 knows."""

from pathlib import Path

import pytest
from mcap_landmarks.cli.console import DONE, PARTIAL, USAGE
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.typestore import definition, typestore
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.sources import ros1_type
from mcap_landmarks.stage import Connection, RawMessage
from rosbags.rosbag1 import Reader as Reader1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.cli.calls import call
from tests.sources.bags import ROS1, write_ros1

Messages = list[tuple[str, int, str, bytes]]


def messages(path: Path) -> Messages:
    """Topic, time, type and content of all messages of a bag, the seq of headers aside, which ROS 2 does not have."""
    with Reader1(path) as reader:
        store = get_typestore(Stores.EMPTY)
        for connection in reader.connections:
            store.register(
                {
                    name: fields
                    for name, fields in get_types_from_msg(connection.msgdef.data, connection.msgtype).items()
                    if name not in store.fielddefs
                }
            )
        found = []
        for connection, time_ns, data in reader.messages():
            message = store.deserialize_ros1(data, connection.msgtype)
            _forget_seq(message)
            topic = "/" + connection.topic.strip("/")
            content = bytes(store.serialize_ros1(message, connection.msgtype))
            found.append((topic, time_ns, connection.msgtype.replace("tf/msg/tf", "tf2_msgs/msg/TF"), content))
    return sorted(found)


def _forget_seq(message: object) -> None:
    if hasattr(message, "seq") and hasattr(message, "frame_id"):
        setattr(message, "seq", 0)  # noqa: B010 - no checker knows the class
    for value in getattr(message, "__dict__", {}).values():
        for one in value if isinstance(value, list) else [value]:
            _forget_seq(one)


def test_a_bag_comes_back_as_it_was(tmp_path: Path, shared_data: Path) -> None:
    source = shared_data / "bags" / "rosbagjs_example_lz4.bag"
    assert call("convert", source, "-o", tmp_path / "log.mcap") == DONE
    assert call("convert", tmp_path / "log.mcap", "-o", tmp_path / "again.bag", "--to", "bag") == DONE
    wanted = messages(source)
    assert messages(tmp_path / "again.bag") == wanted
    with Reader1(source) as before, Reader1(tmp_path / "again.bag") as after:
        known = {connection.topic: connection.digest for connection in before.connections}
        assert {one.topic: one.digest for one in after.connections if not one.msgtype.startswith("tf")} == {
            topic: digest for topic, digest in known.items() if not topic.startswith("/tf")
        }


def test_types_have_the_checksums_that_ros1_knows() -> None:
    """By these its nodes tell whether they can read a topic."""
    both = [name for name in sorted(typestore().fielddefs) if name in ROS1.fielddefs]
    assert len(both) == 119
    for name in (*both[::10], "sensor_msgs/msg/CameraInfo", "visualization_msgs/msg/Marker"):
        found = ros1_type(name, definition(name).encode(), "ros2msg")
        assert found.md5sum == ROS1.generate_msgdef(name)[1], name
    transforms = ros1_type("tf2_msgs/msg/TFMessage", definition("tf2_msgs/msg/TFMessage").encode(), "ros2msg")
    assert transforms.md5sum == "94810edda583a504dfda3829e70d7eec"  # as rosmsg md5 gives it


def test_events_of_services_arrive(tmp_path: Path, shared_data: Path) -> None:
    """Their definition is that of the service, in rosbag2's own files."""
    source = shared_data / "bags" / "topics_and_services.mcap"
    assert call("convert", source, "-o", tmp_path / "a.bag", "--to", "bag") == DONE
    assert len(messages(tmp_path / "a.bag")) == 13


def test_every_type_of_a_bag_arrives(tmp_path: Path, shared_data: Path) -> None:
    source, out = shared_data / "bags" / "rosbags_rs_sqlite3", tmp_path / "a.bag"
    assert call("convert", source, "-o", out, "--to", "bag") in {DONE, PARTIAL}
    assert len(messages(out)) == 188
    assert call("convert", out, "-o", tmp_path / "again.mcap") == DONE


def test_names_compression_and_what_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_ros1(tmp_path / "a.bag")
    (tmp_path / "out").mkdir()
    assert call("convert", source, "-o", tmp_path / "out", "--to", "bag", "--compression", "bz2") == DONE
    assert messages(tmp_path / "out" / "a.bag") == messages(source)
    with Reader1(tmp_path / "out" / "a.bag") as reader:
        assert [(one.topic, one.ext.latching) for one in reader.connections] == [("/scan", None), ("/talk", 1)]  # type: ignore[union-attr]
    capsys.readouterr()
    for options, words in (
        (("-o", tmp_path / "out" / "a.bag", "--to", "bag"), "exists and is no earlier result"),
        (("-o", tmp_path / "b.bag"), "make a bag with --to bag"),
        (("-o", tmp_path / "b.mcap", "--to", "bag"), "--to bag writes ROS 1 bags; name the output b.bag"),
        (("-o", tmp_path / "b.bag", "--to", "bag", "--split-count", "3"), "writes each log as one file"),
        (("-o", tmp_path / "b.bag", "--to", "bag", "--compression", "zstd"), "choose lz4, bz2 or none"),
    ):
        assert call("convert", source, *options) == USAGE
        assert words in capsys.readouterr().err
    first = (tmp_path / "out" / "a.bag").read_bytes()
    assert call("convert", source, "-o", tmp_path / "c.bag", "--to", "bag", "--compression", "bz2") == DONE
    assert (tmp_path / "c.bag").read_bytes() == first


def test_what_ros1_cannot_hold_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    name = "sensor_msgs/msg/Range"
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](1, 2), "sonar")
    sent = [store.types[name](header, 0, 0.1, 0.0, 5.0, 1.0, variance) for variance in (0.0, 0.5)]
    ranges = Connection("/range", name, store.generate_msgdef(name, ros_version=2)[0].encode())
    wide = Connection("/wide", "my_msgs/msg/Wide", b"wstring text\n")
    words = Connection("/words", "", b"", "", "json")
    with create_recording(tmp_path / "log.mcap", profile="") as writer:
        for i, message in enumerate(sent):
            writer.write(RawMessage(ranges, i, i, 0, bytes(store.serialize_cdr(message, name))))
        writer.write(RawMessage(ranges, 3, 3, 0, b"\0\1\0\0"))
        writer.write(RawMessage(wide, 4, 4, 0, b"\0\1\0\0\0\0\0\0"))
        writer.write(RawMessage(words, 5, 5, 0, b"{}"))
    assert call("convert", tmp_path / "log.mcap", "-o", tmp_path / "a.bag", "--to", "bag") == PARTIAL
    out, err = capsys.readouterr()
    assert out == f"{tmp_path / 'a.bag'}: 2 messages, 1 topic\n"
    for said in (
        "topic /wide (my_msgs/msg/Wide), 1 message: ROS 1 has no wide text (wstring)",
        "topic /words, 1 message: its messages are json",
        "/range: 1 message left out, since 4 bytes are not a sensor_msgs/msg/Range",
        "/range: ROS 1's sensor_msgs/msg/Range lacks fields that 1 message have values in",
        "3 of 5 declared messages could not be read",
    ):
        assert said in err
    assert len(messages(tmp_path / "a.bag")) == 2
    assert call("convert", tmp_path / "log.mcap", "-o", tmp_path / "b.bag", "--to", "bag", "--strict") == 1


def test_bounds_services_and_byte_orders() -> None:
    schema = b"string<=5 name\nuint8[<=3] data\nmy_msgs/srv/Do_Request[] requests\n"
    schema += b"=" * 80 + b"\nMSG: my_msgs/srv/Do_Request\nint32 x\n"
    found = ros1_type("my_msgs/srv/Do_Event", schema, "ros2msg")
    assert found.message_type == "my_msgs/msg/Do_Event"
    assert found.definition.startswith("string name\nuint8[] data\nmy_msgs/Do_Request[] requests\n")
    little = b"\0\1\0\0" + b"\3\0\0\0ab\0\0" + b"\1\0\0\0\7\0\0\0" + b"\1\0\0\0\5\0\0\0"
    big = b"\0\0\0\0" + b"\0\0\0\3ab\0\0" + b"\0\0\0\1\7\0\0\0" + b"\0\0\0\1\0\0\0\5"
    wanted = b"\2\0\0\0ab" + b"\1\0\0\0\7" + b"\1\0\0\0\5\0\0\0"
    assert [bytes(found.convert(data)[0]) for data in (little, big)] == [wanted] * 2
    with pytest.raises(MessageError, match="3 bytes are not a my_msgs/srv/Do_Event"):
        found.convert(b"\0\1\0")
    with pytest.raises(MessageError, match="nothing defines b_msgs/msg/Missing"):
        ros1_type("a_msgs/msg/A", b"b_msgs/Missing x", "ros2msg")
