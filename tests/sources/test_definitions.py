"""Definitions that a bag lacks: from where they come, in which order, and that only those count which messages fit."""

import sqlite3
from pathlib import Path

import pytest
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.sources._definition_files import DefinitionFiles
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources.rosbag2 import SOURCE, Rosbag2Config
from mcap_landmarks.stage import RawMessage
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.sources.bags import HUMBLE, write_plain_db3

JAZZY = get_typestore(Stores.ROS2_JAZZY)
STATE = "std_msgs/Header header\nint32[<=3] codes 7\nMode mode\n"
MODE = "uint8 IDLE=0\nuint8 mode\n"
SERVICE = "# what to do\nint32 mode\nmy_msgs/Mode[] modes\n---\nbool ok\nstring why\n"


def package(folder: Path) -> Path:
    """A share folder with one package."""
    for kind, name, text in (
        ("msg", "State.msg", STATE), ("msg", "Mode.msg", MODE), ("srv", "SetMode.srv", SERVICE),
        ("action", "Drive.action", "float64 x\n---\nbool there\n---\nfloat64 left\n"),
    ):  # fmt: skip
        (folder / "my_msgs" / kind).mkdir(parents=True, exist_ok=True)
        (folder / "my_msgs" / kind / name).write_text(text)
    (folder / "my_msgs/msg/Pair.idl").write_text(
        '#include "my_msgs/msg/Mode.idl"\n\nmodule my_msgs {\n  module msg {\n'
        "    struct Pair {\n      my_msgs::msg::Mode one;\n\n      double x;\n    };\n  };\n};\n"
    )
    return folder


def of(message_type: str, *paths: Path, distributions: tuple[str, ...] = ()) -> str:
    """The text of the definition that counts first."""
    return Definitions(DefinitionFiles([str(path) for path in paths]), distributions).of(message_type)[0].text


def test_the_files_of_packages_are_found_and_completed(tmp_path: Path) -> None:
    share = package(tmp_path)
    state = get_types_from_msg(of("my_msgs/msg/State", share), "my_msgs/msg/State")
    assert [name for name, _ in state["my_msgs/msg/State"][1]] == ["header", "codes", "mode"]
    assert {"std_msgs/msg/Header", "builtin_interfaces/msg/Time", "my_msgs/msg/Mode"} < state.keys()
    assert of("my_msgs/msg/Mode", share / "my_msgs/msg/Mode.msg") == "uint8 IDLE=0\nuint8 mode\n"
    assert of("my_msgs/msg/Pair", share).startswith("my_msgs/Mode one\nfloat64 x\n")
    assert of("my_msgs/srv/SetMode_Request", share).startswith("int32 mode\nmy_msgs/Mode[] modes\n")
    assert of("my_msgs/srv/SetMode_Event", share).startswith(
        "service_msgs/ServiceEventInfo info\n"
        "my_msgs/SetMode_Request[<=1] request\nmy_msgs/SetMode_Response[<=1] response\n"
    )
    assert of("my_msgs/action/Drive_FeedbackMessage", share).startswith(
        "unique_identifier_msgs/UUID goal_id\nmy_msgs/Drive_Feedback feedback\n"
    )


def test_what_the_user_gives_goes_first(tmp_path: Path) -> None:
    own = tmp_path / "std_msgs" / "String.msg"
    own.parent.mkdir()
    own.write_text("string data\nint32 more\n")
    assert of("std_msgs/msg/String", own, distributions=("humble",)) == "string data\nint32 more\n"
    assert of("std_msgs/msg/String", distributions=("humble",)) == "string data\n"


def test_a_distribution_is_asked_for_only_where_they_differ() -> None:
    for name in ("sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "service_msgs/msg/ServiceEventInfo"):
        assert of(name)
    with pytest.raises(MessageError, match="such as --distro"):
        of("visualization_msgs/msg/Marker")
    assert "texture" in of("visualization_msgs/msg/Marker", distributions=("humble",))
    assert "texture" not in of("visualization_msgs/msg/Marker", distributions=("foxy", "humble"))


def test_what_cannot_help_is_not_recommended(tmp_path: Path) -> None:
    with pytest.raises(MessageError, match="neither the file nor humble defines my_msgs/msg/State; give") as given:
        of("my_msgs/msg/State", distributions=("humble",))
    assert "--distro" not in str(given.value)
    with pytest.raises(MessageError, match="nor does what --definitions names; add it there"):
        of("my_msgs/msg/Other", package(tmp_path))
    (tmp_path / "my_msgs/msg/Mode.msg").unlink()
    with pytest.raises(MessageError, match="nothing defines my_msgs/msg/Mode, which my_msgs/msg/State needs"):
        of("my_msgs/msg/State", tmp_path)


def test_bad_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no \.msg"):
        DefinitionFiles([str(tmp_path)])
    (package(tmp_path) / "copy/my_msgs").mkdir(parents=True)
    (tmp_path / "copy/my_msgs/Mode.msg").write_text("uint16 mode\n")
    with pytest.raises(UsageError, match="define my_msgs/msg/Mode differently"):
        of("my_msgs/msg/Mode", tmp_path)
    (tmp_path / "my_msgs/srv/SetMode.srv").write_text("int32 x\n")
    with pytest.raises(MessageError, match="has 1 parts in place of two"):
        of("my_msgs/srv/SetMode_Event", tmp_path)
    (tmp_path / "my_msgs/msg/State.msg").write_text("int32 = = x\n")
    with pytest.raises(MessageError, match=r"State\.msg cannot be understood"):
        of("my_msgs/msg/State", tmp_path)


def converted(path: Path, config: Rosbag2Config) -> tuple[list[RawMessage], list[str]]:
    """The messages of a file, and why topics are left out."""
    with SOURCE.open(path, config) as logs:
        part = logs[0].parts[0]
        part.verify(lambda _topic: True)
        return list(part.messages()), [topic.reason for topic in part.left_out]


def rewrite(path: Path, data: bytes, *, last: bytes | None = None) -> None:
    """Give all messages of a file other content, the last one perhaps its own."""
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET data = ?", (data,))
        if last is not None:
            database.execute("UPDATE messages SET data = ? WHERE id = 20", (last,))
    database.close()


def test_one_message_that_does_not_fit_is_enough(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "a.db3", message_type="std_msgs/msg/UInt16")
    number = b"\0\1\0\0\7\0"
    rewrite(path, number + b"\0\0")  # CDR may be padded to whole words
    assert len(converted(path, Rosbag2Config())[0]) == 20
    rewrite(path, number, last=number + bytes(4))
    messages, (reason,) = converted(path, Rosbag2Config())
    assert messages == []
    assert "10 bytes are not every distribution's std_msgs/msg/UInt16" in reason


def test_the_next_definition_is_tried_where_the_first_does_not_fit(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "bag_0.db3", message_type="sensor_msgs/msg/Range")
    header = JAZZY.types["std_msgs/msg/Header"](JAZZY.types["builtin_interfaces/msg/Time"](1, 2), "sonar")
    made = JAZZY.types["sensor_msgs/msg/Range"](header, 0, 0.1, 0.2, 3.0, 1.0, 0.1)
    rewrite(path, bytes(JAZZY.serialize_cdr(made, "sensor_msgs/msg/Range")))
    messages, (reason,) = converted(path, Rosbag2Config("humble"))
    assert (messages, "humble's sensor_msgs/msg/Range" in reason) == ([], True)
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.db3]\n  ros_distro: jazzy\n"
    )
    messages, reasons = converted(path, Rosbag2Config("humble"))
    assert (len(messages), reasons) == (20, [])
    assert b"variance" in messages[0].connection.schema


def event(service: str, name: str, folder: Path) -> tuple[list[RawMessage], list[str]]:
    """Of a file with events of a service that `name` defines there."""
    path = write_plain_db3(folder / "a.db3", message_type="my_msgs/srv/SetMode_Event")
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE message_definitions(topic_type TEXT, encoding TEXT, encoded_message_definition TEXT)"
        )
        database.execute("INSERT INTO message_definitions VALUES (?, 'ros2msg', ?)", (name, service))
    database.close()
    info = b"\1\0\0\0" + bytes(8) + bytes(range(16)) + bytes(4) + (5).to_bytes(8, "little")
    rewrite(path, b"\0\1\0\0" + info + b"\1\0\0\0" + b"\7\0\0\0" + b"\0\0\0\0")
    return converted(path, Rosbag2Config())


@pytest.mark.parametrize("name", ["my_msgs/srv/SetMode", "my_msgs/srv/SetMode_Event"])
def test_the_event_of_a_service_is_made_from_its_definition(name: str, tmp_path: Path) -> None:
    messages, reasons = event("int32 mode\n---\nbool ok\n", name, tmp_path)
    assert (len(messages), reasons) == (20, [])
    connection = messages[0].connection
    assert connection.message_type == "my_msgs/srv/SetMode_Event"
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(connection.schema.decode(), "my_msgs/msg/SetMode_Event"))
    found = store.deserialize_cdr(messages[0].data, "my_msgs/msg/SetMode_Event")
    assert (found.request[0].mode, len(found.response), found.info.sequence_number) == (7, 0, 5)


def test_an_event_that_is_another_services_is_left_out(tmp_path: Path) -> None:
    messages, (reason,) = event("float64[4] mode\n---\nbool ok\n", "my_msgs/srv/SetMode", tmp_path)
    assert (messages, "bytes are not the file's my_msgs/srv/SetMode_Event" in reason) == ([], True)


def test_a_definition_that_is_written_says_the_same_when_it_is_read() -> None:
    for name in sorted(HUMBLE.fielddefs)[::7]:
        fields = [one for one in HUMBLE.fielddefs[name][1] if one[0] != "structure_needs_at_least_one_member"]
        assert get_types_from_msg(of(name, distributions=("humble",)), name)[name][1] == fields
