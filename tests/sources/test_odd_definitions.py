"""Definitions as ROS 1 bags really hold them: of odd text, without nested types, or empty."""

import struct
import time
from pathlib import Path

import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.sources import OmittedTopic, find_source
from mcap_landmarks.sources._definition_text import decoded, plain
from mcap_landmarks.sources._ros1_types import converted
from mcap_landmarks.sources.rosbag1 import Rosbag1Config
from rosbags.rosbag1 import Writer

from tests.sources.bags import START_NS

FIELDS = b"uint32 count\nmy_msgs/Inner inner\n"
INNER = b"MSG: my_msgs/Inner\nfloat64 x\n"
ODD = {
    "line ends of Windows": b"# count\r\n\r\n" + (FIELDS + b"=" * 80 + b"\n" + INNER).replace(b"\n", b"\r\n"),
    "tabs and trailing spaces": b"uint32\t count \t# how many\n\tmy_msgs/Inner  inner   \n"
    + b"=" * 80
    + b" \n"
    + INNER,
    "short separator": FIELDS + b"====\n" + INNER,
    "long separator, no last line end": FIELDS + b"=" * 99 + b"\nMSG:  my_msgs/Inner \nfloat64 x",
    "mark of an editor": b"\xef\xbb\xbf" + FIELDS + b"=" * 80 + b"\n" + INNER,
    "a comment in Latin-1": b"# gr\xfc\xdfe\n" + FIELDS + b"=" * 80 + b"\n" + INNER,
    "constants": b"string PATH=a#b c='d'\nuint8 low_case=3\nstring VERSION=1.2.3\nbool YES=True\nfloat32 PI=3.14 #=\n"
    b"# a=b\nint32 HEX=0xff\n" + FIELDS + b"=" * 80 + b"\n" + INNER,
}


@pytest.mark.parametrize("text", ODD.values(), ids=ODD)
def test_odd_texts_mean_what_they_say(text: bytes) -> None:
    type_ = converted("my_msgs/Count", decoded(text))
    assert type_.is_sure
    lines = [line for line in type_.definition.splitlines() if "=" not in line]
    assert lines == ["uint32 count", "my_msgs/Inner inner", "MSG: my_msgs/Inner", "float64 x"]
    assert bytes(type_.convert(struct.pack("<Id", 3, 1.5))) == b"\0\1\0\0" + struct.pack("<I4xd", 3, 1.5)


def test_constants_that_can_be_said_in_ros_2_are_kept() -> None:
    lines = converted("my_msgs/Count", decoded(ODD["constants"])).definition.splitlines()
    assert [line for line in lines if "=" in line and "==" not in line] == [
        'string VERSION="1.2.3"', "bool YES=True", "float32 PI=3.14", "int32 HEX=255",
    ]  # fmt: skip


def left_out(folder: Path, ros_type: str, text: str, md5sum: str, data: bytes) -> list[OmittedTopic]:
    """The topics without those of a bag with one message that cannot be carried."""
    path = folder / "a.bag"
    with Writer(path) as writer:
        topic = writer.add_connection("/odd", ros_type.replace("/", "/msg/"), msgdef=text, md5sum=md5sum)
        writer.write(topic, START_NS, data)
    with find_source("rosbag1").open(path, Rosbag1Config()) as logs:
        part = logs[0].parts[0]
        part.verify(lambda _topic: True)
        assert len(part.channels) + len(part.left_out) == 1
        return list(part.left_out)


HEADER = struct.pack("<IIII", 1, 1000, 0, 3) + b"map"


def test_nested_standard_types_are_filled_in_where_messages_fit_them(tmp_path: Path) -> None:
    text, data = "Header header\nfloat64 x\n", HEADER + struct.pack("<d", 2.5)
    assert left_out(tmp_path, "my_msgs/Stamped", text, "c" * 32, data) == []
    (tmp_path / "a.bag").unlink()
    (topic,) = left_out(tmp_path, "my_msgs/Stamped", text, "c" * 32, data + b"more")
    assert "are not a my_msgs/Stamped" in topic.reason
    (tmp_path / "a.bag").unlink()
    (topic,) = left_out(tmp_path, "my_msgs/Stamped", "my_msgs/Other other\n", "c" * 32, data)
    assert "nothing defines my_msgs/msg/Other, which my_msgs/msg/Stamped needs" in topic.reason


STRING_MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"


@pytest.mark.parametrize("text", ["", "*", " \n"])
def test_a_standard_type_needs_no_definition(text: str) -> None:
    type_ = converted("std_msgs/String", text, STRING_MD5)
    assert (type_.message_type, type_.is_sure) == ("std_msgs/msg/String", True)
    assert bytes(type_.convert(b"\2\0\0\0ok")) == b"\0\1\0\0\3\0\0\0ok\0"
    assert not converted("std_msgs/String", text, "*").is_sure
    with pytest.raises(MessageError, match="its checksum is another"):
        converted("std_msgs/String", text, "0" * 32)
    with pytest.raises(MessageError, match="nothing defines my_msgs/msg/Own"):
        converted("my_msgs/Own", text, "*")


def test_a_message_without_fields_has_an_empty_definition() -> None:
    type_ = converted("my_msgs/Nothing", "", "d41d8cd98f00b204e9800998ecf8427e")
    assert bytes(type_.convert(b"")) == b"\0\1\0\0\0"


def test_a_type_that_holds_itself_is_refused() -> None:
    with pytest.raises(MessageError, match="my_msgs/msg/Loop holds itself"):
        converted("my_msgs/Loop", "my_msgs/Loop[] loops\n")


@pytest.mark.parametrize(
    ("name", "is_kept"), [("A", True), ("A_1B", True), ("A__B", False), ("A_", False), ("AbC", False)]
)
def test_constants_are_kept_by_the_names_that_the_parser_takes(name: str, is_kept: bool) -> None:
    assert (f"uint8 {name}=3" in plain(f"uint8 {name}=3\nuint8 x\n")) == is_kept


def test_a_long_name_that_is_none_of_a_constant_takes_no_time() -> None:
    """Found by fuzzing: of 60 capitals and digits before a sign each split was tried."""
    began = time.process_time()
    assert "x" in plain(f"uint8 L{'3' * 5000}?=3\nuint8 x\n")
    assert time.process_time() - began < 1
