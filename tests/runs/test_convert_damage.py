"""Conversion of what is damaged or cannot be written: what can be read arrives, the rest is told."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError, UsageError
from rosbags.rosbag1 import Reader as Reader1

from tests.runs.conversion import one, run, stored
from tests.sources.bags import (
    write_plain_db3,
    write_ros1,
    write_ros2,
)


def test_a_cut_bag_gives_an_output_and_its_losses(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag")
    source.write_bytes(source.read_bytes()[: source.stat().st_size * 3 // 4])
    done = one(source, tmp_path / "out.mcap")
    assert 0 < done.topics.total() < 80
    assert done.losses
    assert stored(tmp_path / "out.mcap").total() == done.topics.total()


def test_a_damaged_chunk_is_counted(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag", compression="bz2")
    with Reader1(source) as reader:
        chunk = reader.chunks[min(reader.chunks)]
    data = bytearray(source.read_bytes())
    data[chunk.datapos + 20] ^= 1
    source.write_bytes(data)
    done = one(source, tmp_path / "out.mcap")
    assert done.declared == 80
    assert done.lost == 80 - done.topics.total() > 0
    assert done.losses[0].startswith("a.bag: the chunk at byte")


def test_where_nothing_can_be_read_nothing_is_written(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag")
    source.write_bytes(source.read_bytes()[:4300])
    with pytest.raises(RecordingError, match="no message can be read"):
        run(source, tmp_path / "out.mcap")
    empty = write_plain_db3(tmp_path / "empty.db3", count=0)
    with pytest.raises(RecordingError, match="there are no messages in it"):
        run(empty, tmp_path / "out.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "empty.db3"]


def test_a_log_that_fails_among_several_does_not_stop_the_others(tmp_path: Path) -> None:
    good, bad = write_ros1(tmp_path / "good.bag"), write_plain_db3(tmp_path / "bad.db3", message_type="my_msgs/msg/Own")
    conversion = run([bad, good], tmp_path / "out")
    assert [entry.path.name for entry in conversion.outputs] == ["good.mcap"]
    assert "my_msgs/msg/Own" in str(conversion.failures[0])
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["good.mcap"]


def test_the_input_is_never_the_output(tmp_path: Path) -> None:
    source = tmp_path / "a.mcap"
    one(write_ros1(tmp_path / "a.bag"), source)
    before = source.read_bytes()
    with pytest.raises(UsageError, match="is the input itself"):
        run(source, source)
    assert source.read_bytes() == before
    folder = write_ros2(tmp_path / "bag", storage="mcap")
    with pytest.raises(UsageError, match="is part of the input"):
        run(folder, folder / "bag.mcap")
    with pytest.raises(UsageError, match="is given 2 times"):
        run([source, source], tmp_path / "out.mcap")


@pytest.mark.slow
def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag", count=2000)
    program = "from mcap_landmarks.cli.main import run; run()"
    done = subprocess.run(
        [sys.executable, "-c", program, "convert", source, "-o", tmp_path / "out.mcap"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "free space" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.bag"]


def test_a_log_whose_first_bytes_are_damaged_is_converted_by_its_last_ones(tmp_path: Path) -> None:
    whole = one(write_ros1(tmp_path / "a.bag"), tmp_path / "a.mcap")
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[:8] = bytes(8)
    (tmp_path / "b.mcap").write_bytes(data)
    assert one(tmp_path / "b.mcap", tmp_path / "out.mcap").topics == whole.topics
    (tmp_path / "c.mcap").write_bytes(bytes(8) + data[8:-8])
    with pytest.raises(RecordingError, match="is not an MCAP file, whatever its name says"):
        run(tmp_path / "c.mcap", tmp_path / "none.mcap")
