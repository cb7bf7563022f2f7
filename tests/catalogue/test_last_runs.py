"""The last run of each log in a catalogue: where its output lies now, or why there is none."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from mcap_landmarks.catalogue.catalogue_file import append_rows
from mcap_landmarks.catalogue.last_runs import kept_as, last_runs
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import location

from tests.catalogue.rows import row


def test_the_last_one_counts_and_what_is_gone_is_named(tmp_path: Path) -> None:
    place = tmp_path / "runs.db"
    (tmp_path / "new" / "north").mkdir(parents=True)
    for name in ("new/north/a.mcap", "new/b.mcap"):
        (tmp_path / name).touch()
    rows = [
        row("b.mcap", "new/b.mcap", 2),  # a selection of rows may have any order
        row("a.mcap", "old/a.mcap"),
        row("a.mcap", "new/north/a.mcap", 1),
        row("b.mcap", "old/b.mcap", 1),
        row("c.mcap", "new/c.mcap", 1),
        row("d.mcap", "new/d.mcap"),
        row("d.mcap", None, 1, errors="error: d.mcap: it has no odometry; map needs it\nerror: more"),
        row("a.mcap", "figures/a.json", 3, "evaluate"),
    ]
    append_rows(place, rows)
    found = {run.log: run for run in last_runs(place)}
    assert list(found) == ["a.mcap", "b.mcap", "c.mcap", "d.mcap"]
    assert (found["a.mcap"].name, found["a.mcap"].output) == ("north/a", tmp_path / "new/north/a.mcap")
    assert (found["b.mcap"].name, found["b.mcap"].output) == ("b", tmp_path / "new/b.mcap")
    gone, failed = found["c.mcap"], found["d.mcap"]
    assert gone.output is failed.output is None
    assert gone.error == f"{tmp_path}/new/c.mcap: is gone, which the last run of c.mcap wrote; run it again"
    assert failed.error == "d.mcap: its last run left no output: d.mcap: it has no odometry; map needs it"


def test_figures_alone_are_no_results(tmp_path: Path) -> None:
    append_rows(tmp_path / "runs.db", [row("a.mcap", "a.json", verb="evaluate")])
    with pytest.raises(RecordingError, match="has no run that made results"):
        last_runs(tmp_path / "runs.db")


@pytest.mark.parametrize("name", ["runs.parquet", "runs.db"])
def test_what_is_not_there_is_told_from_what_is_empty(name: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=f"{name}: there is no such file; check the path"):
        last_runs(tmp_path / name)


def test_what_is_neither_a_map_nor_a_catalogue_is_told_so(tmp_path: Path) -> None:
    place = tmp_path / "runs.db"
    neither = f"{place}: is neither a landmark database nor a catalogue"
    place.write_text("<!doctype html>")
    with pytest.raises(RecordingError) as caught:
        last_runs(place)
    assert str(caught.value) == f"{neither} (it is no SQLite database); name one that map or batch --catalogue wrote"
    for columns, reason in (
        ("log TEXT, output TEXT, verb TEXT, started TIMESTAMP", "as it has no column outcome"),
        ("log INTEGER, output TEXT, verb TEXT, outcome TEXT, started TIMESTAMP", "as its column log is of another"),
    ):
        place.unlink()
        with closing(sqlite3.connect(place)) as database:
            database.execute(f"CREATE TABLE runs ({columns})")
        with pytest.raises(RecordingError, match=f"{neither}, {reason}"):
            last_runs(place)


def test_a_selection_that_sqlite_made_is_a_catalogue_still(tmp_path: Path) -> None:
    place = tmp_path / "runs.db"
    append_rows(place, [row("a.mcap", "a.mcap", bundles=3)])
    with closing(sqlite3.connect(place)) as database:
        database.execute("ALTER TABLE runs RENAME TO every")
        database.execute("CREATE TABLE runs AS SELECT log, output, verb, outcome, started, bundles FROM every")
        database.commit()
    assert [run.log for run in last_runs(place)] == ["a.mcap"]


def test_relative_paths_are_as_seen_from_the_catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert kept_as(Path("out/a.mcap"), Path("out/runs.db")) == "a.mcap"
    assert kept_as(Path("logs/a.mcap"), Path("out/runs.db")) == "../logs/a.mcap"
    assert kept_as(tmp_path / "a.mcap", Path("runs.db")) == f"{tmp_path}/a.mcap"
    assert kept_as(location("s3://bucket/a.mcap"), Path("runs.db")) == "s3://bucket/a.mcap"
    assert kept_as(Path("a.mcap"), location("s3://bucket/runs.db")) == f"{tmp_path}/a.mcap"
