"""The landmark database keeps a map, whole and to the byte, and refuses what is none."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_landmarks.errors import MapError, UsageError
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource

from tests.maps.examples import assert_same_map, small_map

FINITE = st.floats(-1e6, 1e6)


@st.composite
def maps(draw: st.DrawFn) -> LandmarkMap:
    ids = draw(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1), unique=True))
    n = len(ids)
    half = draw(arrays(np.float64, (n, 2, 2), elements=st.floats(-10, 10)))
    return LandmarkMap(
        tuple(ids),
        tuple("person" if i % 2 else "fire hydrant" for i in range(n)),
        draw(arrays(np.float64, (n, 2), elements=FINITE)),
        half @ np.swapaxes(half, 1, 2) + 0.01 * np.eye(2),
        draw(arrays(np.float64, n, elements=st.floats(0, 5))),
        draw(arrays(np.int64, n, elements=st.integers(0, 10**6))),
        draw(arrays(np.bool_, n)),
        sources=(MapSource("recording", "abc", 7, 5),),
    )


@pytest.mark.slow
@settings(max_examples=25)
@given(maps())
def test_map_survives_the_database(tmp_path_factory: pytest.TempPathFactory, landmark_map: LandmarkMap) -> None:
    path = tmp_path_factory.mktemp("map") / "map.db"
    write_map(path, landmark_map)
    assert_same_map(read_map(path), landmark_map)


def test_groups_and_sources_survive(tmp_path: Path) -> None:
    write_map(tmp_path / "map.db", small_map())
    assert_same_map(read_map(tmp_path / "map.db"), small_map())


def test_same_map_gives_same_bytes_over_an_old_one(tmp_path: Path) -> None:
    first, second = tmp_path / "a.db", tmp_path / "b.db"
    write_map(first, LandmarkMap.surveyed(("x",), ("person",), [[1, 2]], MapSource("import", "f")))
    write_map(first, small_map())
    write_map(second, small_map())
    assert first.read_bytes() == second.read_bytes()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.db", "b.db"]


def test_reading_leaves_nothing_behind(tmp_path: Path) -> None:
    path = tmp_path / "100% #1?.db"
    write_map(path, small_map())
    path.chmod(0o444)
    read_map(path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_missing_map_names_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="no such map; build it with `map`"):
        read_map(tmp_path / "none.db")


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"SQLite format 3\0" + b"\xff" * 200])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "map.db"
    path.write_bytes(content)
    with pytest.raises(MapError, match=r"no landmark database|not a landmark database"):
        read_map(path)


def test_a_recording_is_told_from_a_damaged_map(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(200))
    with pytest.raises(MapError, match="is a recording and no landmark database; `map` makes one of it"):
        read_map(path)


def change(path: Path, statement: str) -> None:
    with sqlite3.connect(path) as database:
        database.execute(statement)
    database.close()


def test_other_schema_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    write_map(path, small_map())
    change(path, "PRAGMA user_version = 7")
    with pytest.raises(MapError, match="schema version 7, this program speaks 1; build the map again"):
        read_map(path)


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM map",
        "DROP TABLE source",
        "DELETE FROM member",
        "DELETE FROM landmark WHERE number = 1",
        "UPDATE landmark SET cov_xy_m2 = 1e9 WHERE number = 1",
    ],
)
def test_damaged_content_is_refused(tmp_path: Path, statement: str) -> None:
    path = tmp_path / "map.db"
    write_map(path, small_map())
    change(path, statement)
    with pytest.raises(MapError):
        read_map(path)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE landmark SET radius_m = -1",
        "UPDATE landmark SET id = 'same'",
        "UPDATE landmark SET x_m = 'far'",
        "UPDATE landmark_group SET var_x_m2 = NULL WHERE number = 0",
        "UPDATE source SET used = bundles + 1",
        "UPDATE source SET kind = 'rumour'",
    ],
)
def test_the_schema_itself_refuses_nonsense(tmp_path: Path, statement: str) -> None:
    path = tmp_path / "map.db"
    write_map(path, small_map())
    with pytest.raises(sqlite3.IntegrityError):
        change(path, statement)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist; create it"):
        write_map(tmp_path / "none" / "map.db", small_map())
