"""Damage in the middle of bags costs what is damaged, and not what lies behind it."""

import sqlite3
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader as Reader1

from tests.runs.conversion import one
from tests.sources.bags import write_plain_db3, write_ros1


@pytest.mark.parametrize("compression", [None, "bz2", "lz4"])
@pytest.mark.parametrize("new", [bytes(600), b"\xff" * 40])
def test_behind_a_damaged_stretch_a_bag_goes_on(tmp_path: Path, compression: str | None, new: bytes) -> None:
    source = write_ros1(tmp_path / "a.bag", compression=compression)
    with Reader1(source) as reader:
        places = sorted(reader.chunks)
        in_each = sum(len(entries) for entries in reader.indexes.values()) / len(places)
    data = bytearray(source.read_bytes())
    data[places[3] : places[3] + len(new)] = new
    source.write_bytes(data)
    done = one(source, tmp_path / "o.mcap")
    assert 80 - 4 * in_each <= done.topics.total() < 80
    assert any("passed over from byte" in loss for loss in done.losses)


def test_an_index_that_names_a_chunk_twice_doubles_nothing(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "a.bag")
    with Reader1(source) as reader:
        first, second = sorted(reader.chunks)[:2]
    data = source.read_bytes()
    source.write_bytes(
        data.replace(b"chunk_pos=" + second.to_bytes(8, "little"), b"chunk_pos=" + first.to_bytes(8, "little"))
    )
    done = one(source, tmp_path / "o.mcap")
    assert done.topics.total() == 80
    assert "what could be found by scanning was taken" in done.losses[0]


def test_rows_behind_damaged_pages_are_found(tmp_path: Path) -> None:
    source = write_plain_db3(tmp_path / "a.db3", count=3000)
    with sqlite3.connect(source) as database:
        size = database.execute("PRAGMA page_size").fetchone()[0]
    data = bytearray(source.read_bytes())
    leaves = [at for at in range(size, len(data), size) if data[at] == 0x0D]  # of tables (SQLite file format, 1.6)
    for at in (leaves[len(leaves) // 3], leaves[len(leaves) // 2]):
        data[at : at + size] = bytes(size)
    source.write_bytes(data)
    done = one(source, tmp_path / "o.mcap")
    assert 2800 <= done.topics.total() < 3000
    assert any("damage" in loss for loss in done.losses)
    assert done.lost or any("cannot be read" in loss for loss in done.losses)
