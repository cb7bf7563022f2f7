"""Catalogues as files: both formats hold the same, grow, and are refused where they are none."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from mcap_landmarks.catalogue import parquet_file
from mcap_landmarks.catalogue.catalogue_columns import COLUMNS
from mcap_landmarks.catalogue.catalogue_file import append_rows, check_catalogue, is_catalogue, read_catalogue
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.maps.database import read_manifest

from tests.catalogue.rows import STARTED, row

MAP_DB = Path(__file__).parents[1] / "golden" / "map.db"
PLACES = ("runs.parquet", "runs.db", "runs.sqlite")


@pytest.mark.parametrize("name", PLACES)
def test_rows_come_back_and_more_are_appended(name: str, tmp_path: Path) -> None:
    place = tmp_path / name
    assert read_catalogue(place).rows == ()
    append_rows(place, [row("a.mcap", "out/a.mcap", bundles=12, rmse_m=0.25, errors='one\n"two"')])
    append_rows(place, [row("b.mcap", None, 1, seconds_of_another=1.5), row("c.mcap", "out/c.mcap", 1)])
    found = read_catalogue(place)
    assert list(found.columns) == [*COLUMNS, "seconds_of_another"]
    assert dict(list(found.columns.items())[:-1]) == COLUMNS
    assert [(one["log"], one["output"]) for one in found.rows] == [
        ("a.mcap", "out/a.mcap"),
        ("b.mcap", None),
        ("c.mcap", "out/c.mcap"),
    ]
    first, second, _ = found.rows
    assert (first["started"], first["bundles"], first["rmse_m"], first["errors"]) == (STARTED, 12, 0.25, 'one\n"two"')
    assert (first["seconds_of_another"], second["seconds_of_another"]) == (None, 1.5)
    assert {type(one["bundles"]) for one in found.rows} == {int, type(None)}
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


@pytest.mark.parametrize("name", PLACES)
def test_the_same_rows_are_the_same_bytes(name: str, tmp_path: Path) -> None:
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        append_rows(tmp_path / folder / name, [row("a.mcap", "a.mcap", bundles=3), row("b.mcap", None)])
    assert (tmp_path / "x" / name).read_bytes() == (tmp_path / "y" / name).read_bytes()


def test_what_is_no_catalogue_is_refused_and_stays(tmp_path: Path) -> None:
    def other_table(place: Path) -> None:
        with closing(sqlite3.connect(place)) as database:
            database.execute("CREATE TABLE runs (log TEXT)")

    def text(place: Path) -> None:
        place.write_text("no table")

    def own_map(place: Path) -> None:
        place.write_bytes(MAP_DB.read_bytes())

    cases: list[tuple[str, Callable[[Path], None], str]] = [
        ("a.parquet", text, "is no catalogue"),
        ("b.db", text, "is no catalogue"),
        ("c.db", own_map, "no such table: runs"),
        ("d.sqlite", other_table, "has no column output"),
    ]
    for name, make, reason in cases:
        place = tmp_path / name
        make(place)
        before = place.read_bytes()
        with pytest.raises(UsageError, match=reason):
            check_catalogue(place)
        with pytest.raises(RecordingError, match=reason):
            append_rows(place, [row("a.mcap", None)])
        assert place.read_bytes() == before
        assert is_catalogue(place) is (name != "c.db")  # reading it says what is wrong
    with pytest.raises(UsageError, match=r"runs.csv: a catalogue is named .parquet, .db, .sqlite"):
        check_catalogue(tmp_path / "runs.csv")
    assert read_manifest(MAP_DB)


def test_a_column_of_another_type_is_told(tmp_path: Path) -> None:
    place = tmp_path / "runs.db"
    append_rows(place, [row("a.mcap", "a.mcap")])
    with closing(sqlite3.connect(place)) as database:
        database.execute("ALTER TABLE runs DROP COLUMN rmse_m")
        database.execute("ALTER TABLE runs ADD COLUMN rmse_m TEXT")
        database.commit()
    with pytest.raises(UsageError, match="column rmse_m is of another type"):
        check_catalogue(place)


def test_without_pyarrow_the_remedy_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet_file.importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(UsageError, match=r"pip install 'mcap-landmarks\[parquet\]'"):
        check_catalogue(tmp_path / "runs.parquet")
    check_catalogue(tmp_path / "runs.db")
