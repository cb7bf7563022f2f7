"""recover tells of bags, as of recordings, how many messages are lost and why: printed, as JSON, in the output."""

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
from jsonschema import validate
from mcap.reader import make_reader
from rosbags.rosbag1 import Reader as Reader1

from tests.cli.calls import call, schema_of
from tests.sources.bags import write_plain_db3, write_ros1, write_ros2

Lost = dict[str, int | None]


def _recover(log: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    """The document, which the output's record has, too; and what is lost, in one line."""
    out = log.with_name("out.mcap")
    assert call("recover", log, "-o", out, "--json", "--overwrite") == 3
    document: dict[str, object] = json.loads(capsys.readouterr().out)
    validate(document, schema_of("recover"))
    with out.open("rb") as stream:
        (record,) = (m.metadata for m in make_reader(stream).iter_metadata() if m.name == "mcap-landmarks.recover")
    same = {name: json.loads(text) for name, text in record.items() if name != "notes"}
    assert same == {name: document[name] for name in same}
    assert {"expected", "recovered", "lost", "suspect_chunks", "resyncs", "losses"} <= same.keys()
    assert call("recover", log, "-o", out) == 3
    assert ("messages lost: " in capsys.readouterr().out) == bool(document["lost"])
    return document


def _chunk(bag: Path, number: int) -> tuple[int, int]:
    """Where a chunk of a bag begins, and how many messages it has."""
    with Reader1(bag) as reader:
        place = sorted(reader.chunks)[number]
        return place, sum(entry.chunk_pos == place for entries in reader.indexes.values() for entry in entries)


def test_a_damaged_chunk_of_a_bag_is_told_with_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_ros1(tmp_path / "a.bag", compression="bz2")
    place, held = _chunk(bag, 3)
    data = bytearray(bag.read_bytes())
    data[place + 120 : place + 160] = bytes(40)
    bag.write_bytes(data)
    document = _recover(bag, capsys)
    assert (document["expected"], document["recovered"]) == (80, 80 - held)
    assert document["lost"] == {"damaged_chunks": held}
    (chunk,) = document["suspect_chunks"]  # type: ignore[misc]
    assert (chunk["offset"], chunk["messages"]) == (place, held)


def test_what_a_bag_lacks_behind_a_cut_or_a_stretch_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_ros1(tmp_path / "a.bag")
    whole = bag.read_bytes()
    place, _ = _chunk(bag, 3)
    bag.write_bytes(whole[:place] + bytes(600) + whole[place + 600 :])
    document = _recover(bag, capsys)
    (stretch,) = document["resyncs"]  # type: ignore[misc]
    assert stretch["from"] <= place < stretch["to"]
    assert document["lost"] == {"passed_over": None}
    assert document["expected"] is None
    bag.write_bytes(whole[: place + 300])
    assert "cut" in _recover(bag, capsys)["lost"]  # type: ignore[operator]


def test_messages_that_do_not_fit_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_ros1(tmp_path / "a.bag", count=10)
    data = bag.read_bytes()
    for number in (2, 5):  # a text that claims to be longer than its message
        words = f"word {number}".encode()
        data = data.replace(len(words).to_bytes(4, "little") + words, (99).to_bytes(4, "little") + words)
    bag.write_bytes(data)
    document = _recover(bag, capsys)
    assert document["lost"] == {"not_fitting": 2}
    assert (document["expected"], document["recovered"]) == (20, 18)


def _without_payload(database: sqlite3.Connection) -> None:
    database.execute("UPDATE messages SET data = 'words' WHERE id IN (3, 4, 9)")


def _undescribed(database: sqlite3.Connection) -> None:
    database.execute("UPDATE messages SET topic_id = 77 WHERE id IN (3, 4)")


def _damaged_frames(database: sqlite3.Connection) -> None:
    database.execute("UPDATE messages SET data = substr(data, 1, length(data) - 8) WHERE id IN (3, 4)")


@pytest.mark.parametrize(
    ("damage", "mode", "lost", "expected"),
    [
        (_without_payload, None, {"unsound_rows": 3}, 40),
        (_undescribed, None, {"without_topic": 2}, 40),
        (_damaged_frames, "message", {"not_decompressed": 2}, 40),
    ],
)
def test_rows_of_a_db3_that_are_lost_are_counted_by_cause(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    damage: Callable[[sqlite3.Connection], None],
    mode: str | None,
    lost: Lost,
    expected: int | None,
) -> None:
    (file,) = write_ros2(tmp_path / "bag", mode=mode).glob("*.db3")
    with sqlite3.connect(file) as database:
        damage(database)
    database.close()
    document = _recover(tmp_path / "bag", capsys)
    assert document["lost"] == lost
    assert document["expected"] == expected
    assert document["recovered"] == 40 - sum(count or 0 for count in lost.values())


@pytest.mark.parametrize("has_index", [True, False])
def test_rows_in_damaged_pages_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str], has_index: bool) -> None:
    source = write_plain_db3(tmp_path / "a.db3", count=3000, index=has_index)
    with sqlite3.connect(source) as database:
        size = database.execute("PRAGMA page_size").fetchone()[0]
    database.close()
    data = bytearray(source.read_bytes())
    leaves = [at for at in range(size, len(data), size) if data[at] == 0x0D]  # of tables (SQLite file format, 1.6)
    for at in (leaves[len(leaves) // 3], leaves[len(leaves) // 2]):
        data[at : at + size] = bytes(size)
    source.write_bytes(data)
    document = _recover(source, capsys)
    assert document["lost"] == {"unreadable_rows": 3000 - document["recovered"]}  # type: ignore[operator]
    assert document["expected"] == 3000


def test_how_many_rows_a_cut_file_lacks_nothing_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_plain_db3(tmp_path / "a.db3", count=3000, index=False)
    data = bytearray(source.read_bytes())
    size = int.from_bytes(data[16:18], "big")
    leaves = [at for at in range(size, len(data), size) if data[at] == 0x0D]
    data[leaves[len(leaves) // 3] : leaves[len(leaves) // 3] + size] = bytes(size)
    source.write_bytes(data[: leaves[len(leaves) // 2]])
    document = _recover(source, capsys)
    assert (document["expected"], document["lost"]) == (None, {"unreadable_rows": None})


def test_a_bag_of_recordings_tells_as_they_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = tmp_path / "bag"
    source = write_ros1(tmp_path / "a.bag")
    assert call("convert", source, "-o", bag, "--to", "rosbag2", "--split-count", 30, "--chunk-size", "1K") == 0
    capsys.readouterr()
    first, second, _ = sorted(bag.glob("*.mcap"))
    data = bytearray(first.read_bytes())
    with first.open("rb") as stream:
        place = make_reader(stream).get_summary().chunk_indexes[1].chunk_start_offset  # type: ignore[union-attr]
    data[place + 80 : place + 90] = bytes(10)
    first.write_bytes(data)
    document = _recover(bag, capsys)
    lost = document["lost"]["damaged_chunks"]  # type: ignore[index]
    assert (document["expected"], document["recovered"]) == (80, 80 - lost)
    second.unlink()
    document = _recover(bag, capsys)
    assert document["lost"] == {"damaged_chunks": lost, "missing": None}
    assert document["expected"] is None


def test_a_topic_that_nobody_understands_is_a_cause(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (file,) = write_ros2(tmp_path / "bag").glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("UPDATE topics SET type = 'my_msgs/msg/Thing' WHERE name = '/talk'")
        database.execute("DELETE FROM message_definitions")
    database.close()
    document = _recover(tmp_path / "bag", capsys)
    assert document["lost"] == {"not_understood": 20}
    assert (document["expected"], document["recovered"]) == (40, 20)
