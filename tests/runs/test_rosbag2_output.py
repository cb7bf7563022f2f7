"""Back to ROS 2: a folder that rosbag2 plays, with all messages, or the bag that was there before."""

from pathlib import Path

import pytest
from mcap_landmarks.cli.console import DONE, USAGE
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.qos import is_named, named, numbered, qos_profile
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.conversion import Converted
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.output_formats import OutputForm, OutputFormat
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.runs.topic_selection import Selection
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader as Reader2
from ruamel.yaml import YAML

from tests.cli.calls import call
from tests.runs.conversion import doctor, one, stored
from tests.sources.bags import write_mrclam, write_ros1, write_ros2


def to_bag(
    sources: Path | list[Path], folder: Path, split: Split | None = None, *, overwrite: bool = False
) -> Converted:
    several = sources if isinstance(sources, list) else [sources]
    form = OutputForm(split, to=OutputFormat.ROSBAG2)
    (done,) = convert(several, folder, Selection(), {}, unwatched, form=form, overwrite=overwrite).outputs
    return done


def metadata(folder: Path) -> dict[str, object]:
    found: dict[str, object] = YAML(typ="safe", pure=True).load(folder / "metadata.yaml")["rosbag2_bagfile_information"]
    return found


@pytest.mark.parametrize("name", ["rosbags_rs_sqlite3", "rosbag2_split_sqlite3"])
def test_bags_come_back_as_they_were(name: str, tmp_path: Path, shared_data: Path) -> None:
    source = shared_data / "bags" / name
    one(source, tmp_path / "log.mcap")
    done = to_bag(tmp_path / "log.mcap", tmp_path / "bag")
    wanted = stored(source)
    assert stored(tmp_path / "bag") == wanted
    assert (done.topics.total(), done.declared, done.lost) == (wanted.total(), wanted.total(), 0)
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    assert name != "rosbags_rs_sqlite3" or doctor(tmp_path / "bag" / "bag_0.mcap") == []
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_bag_in_parts_is_one_bag(tmp_path: Path) -> None:
    """rosbag2 opens the files in their order; each has a record of its own, as when they were split while recorded."""
    source = write_ros1(tmp_path / "a.bag")
    done = to_bag(source, tmp_path / "bag", Split(count=30))
    with Reader2(tmp_path / "bag") as reader:
        assert (reader.message_count, done.topics.total()) == (80, 80)
        latched = next(connection for connection in reader.connections if connection.topic == "/talk")
        assert latched.ext.offered_qos_profiles[0].durability is QosDurability.TRANSIENT_LOCAL  # type: ignore[union-attr]
    about = metadata(tmp_path / "bag")
    assert about["relative_file_paths"] == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert sum(file["message_count"] for file in about["files"]) == 80  # type: ignore[attr-defined]
    for path in sorted((tmp_path / "bag").glob("*.mcap")):
        with open_recording(path) as recording:
            assert "serialized_metadata" in recording.metadata["rosbag2"]


def test_several_publishers_of_a_topic_are_one_channel(tmp_path: Path) -> None:
    """By their profiles rosbags matches the channels with metadata.yaml, and reads nothing where these differ."""
    done = to_bag([write_ros1(tmp_path / "a.bag"), write_ros2(tmp_path / "b")], tmp_path / "bag")
    assert stored(tmp_path / "bag").total() == done.topics.total() == 120
    assert metadata(tmp_path / "bag")["version"] == 8


def test_what_is_there_is_replaced_only_if_it_is_such_a_bag(tmp_path: Path) -> None:
    source, folder = write_ros1(tmp_path / "a.bag"), tmp_path / "bag"
    folder.mkdir()
    to_bag(source, folder)
    before = (folder / "bag_0.mcap").read_bytes()
    to_bag(source, folder, Split(count=30))
    to_bag(source, folder)
    assert (folder / "bag_0.mcap").read_bytes() == before
    assert len(list(folder.iterdir())) == 2
    other = write_ros2(tmp_path / "b")
    with pytest.raises(UsageError, match="no earlier result"):
        to_bag(other, folder)
    with pytest.raises(UsageError, match="holds the input"):
        to_bag(folder / "bag_0.mcap", folder, overwrite=True)
    to_bag(other, folder, overwrite=True)
    assert stored(folder).total() == 40
    (folder / "notes.txt").touch()
    with pytest.raises(UsageError, match=r"holds notes\.txt, which is of no bag"):
        to_bag(other, folder, overwrite=True)


def test_what_a_killed_run_left_goes_with_the_next(tmp_path: Path) -> None:
    left = tmp_path / ".bag.01234567.partial"
    left.mkdir()
    (left / "bag_0.mcap").touch()
    to_bag(write_ros1(tmp_path / "a.bag"), tmp_path / "bag")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "bag"]


def test_an_output_is_what_its_name_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_ros1(tmp_path / "a.bag")
    for name in ("name", "named.mcap/", "2024.11.27"):
        assert call("convert", source, "-o", f"{tmp_path}/{name}") == DONE
        assert capsys.readouterr().out.startswith(f"{tmp_path / name / 'a.mcap'}: 80 messages")
    assert call("convert", source, "-o", tmp_path / "bag", "--to", "rosbag2") == DONE
    assert capsys.readouterr().out == f"{tmp_path / 'bag'}/: 80 messages, 2 topics\n"
    assert call("convert", write_mrclam(tmp_path / "set"), "-o", tmp_path / "robots", "--to", "rosbag2") == DONE
    assert stored(tmp_path / "robots" / "robot1").total() > 0
    capsys.readouterr()
    (tmp_path / "file").touch()
    for name, options, words in (
        ("x.bag", (), "convert writes MCAP; name the output x.mcap, or make a bag with --to bag"),
        ("x.db3", (), "convert writes MCAP; name the output x.mcap, or make a bag with -o x --to rosbag2"),
        ("x.db3", ("--to", "rosbag2"), "a ROS 2 bag is a folder; name it x"),
        ("x.mcap", ("--to", "rosbag2"), "a ROS 2 bag is a folder; name it x"),
        ("x", ("--to", "db3"), "--to db3: choose mcap, rosbag2 or bag"),
        ("file", (), "is a file and no folder; give the output another name, as NAME.mcap"),
    ):
        assert call("convert", source, "-o", tmp_path / name, *options) == USAGE
        assert words in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_profiles_have_one_form(tmp_path: Path) -> None:
    """rosbag2 reads numbers in bags of version 8, names in those of version 9, and fails on what it does not expect."""
    text = qos_profile(latched=True)
    as_names = named(text)
    assert (is_named(text), is_named(as_names)) == (False, True)
    assert "durability: transient_local" in as_names
    assert numbered(as_names) == text
    assert numbered("[{history: 'keep_all', reliability: \"best_effort\"}]") == "[{history: 2, reliability: 2}]"
    write_ros2(tmp_path / "bag", storage="mcap")
    assert call("convert", tmp_path / "bag", "-o", tmp_path / "again", "--to", "rosbag2") == DONE
    assert metadata(tmp_path / "again")["version"] == 8
