"""Split bags with parts that are damaged or gone, and metadata that say something else than the storage."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer as McapWriter
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.conversion import Converted
from mcap_landmarks.runs.rosbag2_metadata import KEY, RECORD
from mcap_landmarks.sources._bag_metadata import described

from tests.runs.conversion import one
from tests.sources.bags import START_NS, write_plain_db3

SPOIL: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "garbage": lambda path: path.write_bytes(b"\xa5" * 5000),
    "garbage after its first bytes": lambda path: path.write_bytes(path.read_bytes()[:16] + b"\xa5" * 5000),
}


def write_mcap(path: Path, count: int = 20, custom: str = "") -> Path:
    """A small recording with texts on /talk."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        talk = writer.register_channel("/talk", "cdr", schema)
        for i in range(count):
            writer.add_message(talk, START_NS + i, b"\0\1\0\0\2\0\0\0a\0", START_NS + i)
        writer.add_attachment(0, 0, "calibration.yaml", "text/yaml", b"k: 1\n")
        if custom:
            writer.add_metadata("rosbag2", {"serialized_metadata": f"custom_data:\n  {custom}\nros_distro: jazzy\n"})
        writer.finish()
    return path


def write_split(folder: Path, suffix: str, listed: int | None = 3, more: str = "") -> Path:
    """A bag of three parts with 20 messages each."""
    folder.mkdir()
    for i in range(3):
        part = folder / f"bag_{i}.{suffix}"
        write_mcap(part) if suffix == "mcap" else write_plain_db3(part)
    if listed is not None:
        names = ", ".join(f"bag_{i}.{suffix}" for i in range(listed))
        text = f"rosbag2_bagfile_information:\n  relative_file_paths: [{names}]\n{more}"
        (folder / "metadata.yaml").write_text(text)
    return folder


def notes(done: Converted) -> str:
    return "\n".join(done.notes)


@pytest.mark.parametrize("listed", [3, 1, None])
@pytest.mark.parametrize("suffix", ["db3", "mcap"])
@pytest.mark.parametrize("spoil", SPOIL.values(), ids=SPOIL)
def test_sound_parts_are_taken_and_others_named(
    spoil: Callable[[Path], object], suffix: str, listed: int | None, tmp_path: Path
) -> None:
    folder = write_split(tmp_path / "bag", suffix, listed)
    spoil(folder / f"bag_2.{suffix}")
    done = one(folder, tmp_path / "out.mcap")
    assert done.topics == {"/talk": 40}
    assert "bag_2" in " ".join(done.losses)
    assert ("does not list bag_1" in notes(done)) == (listed == 1)
    assert ("is missing; took all 3" in notes(done)) == (listed is None)
    for i in range(2):
        (folder / f"bag_{i}.{suffix}").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"bag_0\.\w+ is empty.*bag_1\.\w+ is empty"):
        one(folder, tmp_path / "none.mcap")
    assert not (tmp_path / "none.mcap").exists()


def test_storage_goes_before_metadata(tmp_path: Path) -> None:
    done = one(write_split(tmp_path / "a", "db3", 3, "  message_count: 61\n"), tmp_path / "a.mcap")
    assert (done.topics.total(), done.losses) == (60, [])
    assert "its metadata count 61 messages, its files hold 60; these were taken" in notes(done)
    done = one(write_split(tmp_path / "b", "db3", 3, "  message_count: 60\n"), tmp_path / "b.mcap")
    assert done.notes == []
    folder = write_split(tmp_path / "c", "db3", 3, "  message_count: [")
    for name in ("bag_0.db3-wal", "bag_0.db3-shm", "notes.txt"):
        (folder / name).touch()
    done = one(folder, tmp_path / "c.mcap")
    assert done.topics.total() == 60
    assert "metadata.yaml is damaged; took all 3 storage files" in notes(done)
    folder = write_split(tmp_path / "d", "db3")
    for i in range(3):
        (folder / f"bag_{i}.db3").rename(folder / f"drive_{i}.db3")
    done = one(folder, tmp_path / "d.mcap")
    assert (done.topics.total(), done.losses) == (60, [])
    assert "lists none of the 3 storage files; took all of them" in notes(done)


def test_what_was_noted_about_a_bag_comes_along(tmp_path: Path) -> None:
    first = write_mcap(tmp_path / "a.mcap", custom="{operator: ada, run: 017}")
    second = write_mcap(tmp_path / "b.mcap", custom="{operator: bob}")
    done = one([first, second], tmp_path / "out.mcap")
    assert "custom_data operator is 'ada' in a.mcap and 'bob' in b.mcap; the first was kept" in notes(done)
    with open_recording(tmp_path / "out.mcap") as recording:
        text = recording.metadata[RECORD][KEY]
        assert [attachment.name for attachment in recording.attachments()] == ["calibration.yaml"] * 2
    about = described(text)
    assert about is not None
    assert about.custom_data == {"operator": "ada", "run": "017"}
    assert (about.distribution, about.messages, about.files) == ("jazzy", 40, ())
    assert about.types == {"/talk": "std_msgs/msg/String"}
    assert "nanoseconds: 19\n" in text
    assert str(tmp_path) not in json.dumps(recording.metadata)


def test_nothing_is_noted_where_nothing_was(tmp_path: Path) -> None:
    one(write_plain_db3(tmp_path / "a.db3"), tmp_path / "out.mcap")
    with open_recording(tmp_path / "out.mcap") as recording:
        assert RECORD not in recording.metadata


@pytest.mark.parametrize("text", ["", "- 1", "a: [", "[" * 500, "custom_data: 3\ncompression: {", "\x00"])
def test_metadata_that_are_none_say_nothing(text: str) -> None:
    assert described(text) is None


def test_values_of_other_kinds_are_passed_over() -> None:
    about = described(
        "relative_file_paths: {a: 1}\nmessage_count: -3\ncustom_data: {a: [1], b: x}\nros_distro: [humble]\n"
    )
    assert about is not None
    assert (about.files, about.messages, about.custom_data, about.distribution) == ((), None, {"b": "x"}, None)
