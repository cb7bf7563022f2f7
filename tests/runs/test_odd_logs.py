"""Logs that a fresh user broke: nothing false arrives, and what is lost or can be done is said."""

from pathlib import Path

import pytest
import zstandard
from mcap.writer import Writer as McapWriter
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.recover import recover

from tests.recording.damages import CHANNEL, MESSAGE, MESSAGE_INDEX, MESSAGES, Truth, of_kind, write
from tests.runs.conversion import one
from tests.runs.test_split_bags import write_split
from tests.sources.bags import write_plain_db3


def read(path: Path) -> list[Truth]:
    with open_recording(path) as recording:
        return [(m.connection.topic, m.sequence, m.log_time_ns, bytes(m.data)) for m in recording.messages()]


@pytest.mark.parametrize("huge", [1 << 40, 2**64 - 1])
def test_a_message_index_that_claims_everything_costs_nothing(tmp_path: Path, huge: int) -> None:
    """Not even where whole chunks are copied with their indexes."""
    data, truth = write()
    place = of_kind(data, MESSAGE_INDEX)[0].start
    (tmp_path / "log.mcap").write_bytes(data[: place + 1] + huge.to_bytes(8, "little") + data[place + 9 :])
    one(tmp_path / "log.mcap", tmp_path / "out.mcap")
    assert read(tmp_path / "out.mcap") == truth


def test_a_message_index_whose_opcode_is_flipped_is_no_message(tmp_path: Path) -> None:
    data, truth = write()
    place = of_kind(data, MESSAGE_INDEX)[0].start
    (tmp_path / "log.mcap").write_bytes(data[:place] + bytes([MESSAGE]) + data[place + 1 :])
    done = recover(tmp_path / "log.mcap", tmp_path / "out.mcap", unwatched)
    assert done.damage.recovered == MESSAGES
    assert read(tmp_path / "out.mcap") == truth


def write_metadata(path: Path, name: str) -> Path:
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        writer.add_message(writer.register_channel("/talk", "cdr", schema), 1, b"\0\1\0\0\2\0\0\0a\0", 1)
        writer.add_metadata(name, {"a": "1"})
        writer.add_metadata(name, {"b": "2"})
        writer.finish()
    return path


@pytest.mark.parametrize("name", ["notes", "rosbag2"])
def test_several_metadata_records_of_a_name_are_no_damage(tmp_path: Path, name: str) -> None:
    """rosbag2 writes its own twice."""
    source = write_metadata(tmp_path / "log.mcap", name)
    assert recover(source, tmp_path / "out.mcap", unwatched).losses == ()
    assert one(source, tmp_path / "out2.mcap").losses == []
    with open_recording(source) as recording, open_recording(tmp_path / "out.mcap") as out:
        assert recording.notes == []
        assert [entries for named, entries in out.metadata_records if named == name] == [{"a": "1"}, {"b": "2"}]


def test_an_id_that_two_channels_have_is_told(tmp_path: Path) -> None:
    data, _ = write(chunked=False, summary=False)
    place = of_kind(data, CHANNEL)[0]
    other = data[place.start : place.end].replace(b"/topic_0", b"/topic_x")
    (tmp_path / "log.mcap").write_bytes(data[: place.end] + other + data[place.end :])
    done = recover(tmp_path / "log.mcap", tmp_path / "out.mcap", unwatched)
    assert "defined twice" in done.losses[0]


def test_a_definition_that_was_given_and_does_not_fit_is_not_asked_for_again(tmp_path: Path) -> None:
    source = write_plain_db3(tmp_path / "a.db3", message_type="my_msgs/msg/Own")
    (tmp_path / "my_msgs").mkdir()
    (tmp_path / "my_msgs/Own.msg").write_text("int8[9] data\n")
    settings = {"rosbag2": {"definitions": [str(tmp_path / "my_msgs")]}}
    with pytest.raises(RecordingError, match="another version") as caught:
        recover(source, tmp_path / "out.mcap", unwatched, settings)
    assert "give its definition" not in str(caught.value)
    (tmp_path / "my_msgs/Own.msg").write_text("string data\n")
    assert recover(source, tmp_path / "out.mcap", unwatched, settings).losses == ()


def test_parts_are_named_by_their_own_paths(tmp_path: Path) -> None:
    """Also where they were unpacked elsewhere, and where nothing could be."""
    folder = write_split(tmp_path / "bag", "db3")
    cut = (folder / "bag_0.db3").read_bytes()
    (folder / "bag_0.db3").write_bytes(cut[: len(cut) // 3])
    packed = zstandard.compress((folder / "bag_1.db3").read_bytes())
    (folder / "bag_1.db3").unlink()
    (folder / "bag_1.db3.zstd").write_bytes(packed[: len(packed) // 3])
    losses = "\n".join(one(folder, tmp_path / "out.mcap").losses)
    assert f"{folder}/bag_0.db3 is no ROS 2 bag, or too damaged" in losses
    assert f"{folder}/bag_1.db3.zstd is cut" in losses
