"""The catalogue that a batch writes: a row per log and run, what it took and what came of it; also when cut off."""

import json
import shutil
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import pytest
from mcap_landmarks import __version__
from mcap_landmarks.atomic import held
from mcap_landmarks.catalogue import catalogue_file
from mcap_landmarks.catalogue.catalogue_columns import COLUMNS, Row
from mcap_landmarks.catalogue.catalogue_file import read_catalogue
from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Ended
from mcap_landmarks.maps.database import read_map
from mcap_landmarks.recording.reader import open_recording

from tests.cli.calls import call, refused
from tests.cli.logs import messages, write

TIMED = {"started", "seconds", "peak_memory_bytes", *(name for name in COLUMNS if name.startswith("seconds_"))}

STATUSES = ("localized", "ambiguous", "too_few_objects", "no_match", "inconsistent", "weak_geometry")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs, one that is none, and a map."""
    here = tmp_path_factory.mktemp("catalogue")
    (here / "logs").mkdir()
    for seed, name in enumerate("ab"):
        write(here / "logs" / f"{name}.mcap", messages(seed=seed, count=40))
    (here / "logs" / "none.mcap").write_text("no recording")
    assert call("map", here / "logs" / "a.mcap", "--map", here / "a.db") == 0
    return here


@pytest.mark.slow
def test_each_run_adds_a_row_per_log(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "runs.parquet"
    shutil.copytree(folder, tmp_path / "fleet")
    monkeypatch.chdir(tmp_path / "fleet")
    localize = ("batch", "localize", "logs/*.mcap", "--map", "a.db", "-o", "out", "--workers", 1, "--catalogue", name)
    assert call(*localize, "--set", "localize.max_sigma_m=0.4") == 3
    assert call(*localize, "--set", "localize.max_sigma_m=0.4") == 3
    assert call("batch", "evaluate", "out/*.mcap", "--align", "-o", "figures", "--workers", 1, "--catalogue", name) == 0
    rows = read_catalogue(Path(name)).rows
    outcomes = [(row["log"], row["verb"], row["outcome"], row["output"]) for row in rows]
    assert outcomes == [
        ("logs/a.mcap", "localize", "done", "out/a.mcap"),
        ("logs/b.mcap", "localize", "done", "out/b.mcap"),
        ("logs/none.mcap", "localize", "failed", None),
        ("logs/a.mcap", "localize", "skipped", "out/a.mcap"),
        ("logs/b.mcap", "localize", "skipped", "out/b.mcap"),
        ("logs/none.mcap", "localize", "failed", None),
        ("out/a.mcap", "evaluate", "done", "figures/a.json"),
        ("out/b.mcap", "evaluate", "done", "figures/b.json"),
    ]
    check_localized(rows[0], rows[3], rows[1])
    failed, measured = rows[2], rows[6]
    assert (failed["exit_code"], failed["attempts"], failed["settings"], failed["position"]) == (1, 1, None, 2)
    assert str(failed["errors"]).startswith("error: logs/none.mcap is not an MCAP file")
    figures = json.loads(Path("figures/a.json").read_text())
    assert (measured["rmse_m"], measured["scored"]) == (figures["position"]["rmse_m"], figures["scored"])
    assert [measured[name] for name in ("fingerprint", "run_key")] == [rows[0]["fingerprint"], rows[0]["run_key"]]
    capsys.readouterr()
    assert call("report", name, "-o", "fleet.html") == 3
    assert "none could not be read: logs/none.mcap: its last run left no output" in capsys.readouterr().err


def check_localized(first: Row, again: Row, other: Row) -> None:
    with open_recording(Path("out/a.mcap")) as recording:
        assert first["fingerprint"] == recording.fingerprint()
    found = [first[name] for name in ("bundles", *STATUSES)]
    assert found[0] == 40 == sum(count for count in found[1:] if isinstance(count, int))
    assert first["localized"]
    assert json.loads(str(first["settings"]))["localize"]["max_sigma_m"] == 0.4
    assert (first["toolkit_version"], first["exit_code"], first["attempts"]) == (__version__, 0, 1)
    assert isinstance(first["started"], datetime)
    assert first["started"].tzinfo is not None
    assert isinstance(first["seconds_localize"], float)
    assert isinstance(first["seconds"], float)
    assert again["seconds_localize"] is None
    assert first["run_key"] == again["run_key"] != other["run_key"]
    differ = {name for name in COLUMNS if first[name] != again[name]}
    assert differ <= TIMED | {"outcome"}


@pytest.mark.slow
def test_the_logs_of_one_map_share_it(folder: Path, tmp_path: Path) -> None:
    words = ("batch", "map", folder / "logs" / "*.mcap", "-o", tmp_path, "--workers", 1)
    assert call(*words, "--catalogue", tmp_path / "runs.db") == 3
    first, second, failed = read_catalogue(tmp_path / "runs.db").rows
    assert [first["output"], second["output"], failed["output"]] == [*[str(tmp_path / "map.db")] * 2, None]
    assert first["bundles"] == second["bundles"] == 40
    assert first["landmarks"] == second["landmarks"] == len(read_map(tmp_path / "map.db"))
    assert first["run_key"] == second["run_key"]
    assert "build_map" in json.loads(str(first["settings"]))
    assert None not in {first["fingerprint"], second["fingerprint"]}
    assert first["fingerprint"] != second["fingerprint"]


def test_of_a_batch_that_is_broken_off_the_rows_that_are_known_are_kept(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = LocalWorkers.run

    def stop_after_one(self: LocalWorkers, *given: object) -> Iterator[Ended]:
        for ended in whole(self, *given):  # type: ignore[arg-type] # what it is given
            yield ended
            raise KeyboardInterrupt

    monkeypatch.setattr(LocalWorkers, "run", stop_after_one)
    words = ("batch", "convert", folder / "logs" / "[ab].mcap", "-o", tmp_path / "out", "--workers", 1)
    assert call(*words, "--catalogue", tmp_path / "runs.db") == 130
    (row,) = read_catalogue(tmp_path / "runs.db").rows
    assert (row["log"], row["outcome"], row["messages"]) == (str(folder / "logs" / "a.mcap"), "done", 121)


def test_what_cannot_be_written_is_told_before_anything_runs_or_at_the_end(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("batch", "convert", folder / "logs" / "a.mcap", "-o", tmp_path / "out", "--catalogue")
    assert "a catalogue is named" in refused(capsys, 2, *words, tmp_path / "runs.csv")
    assert "does not exist" in refused(capsys, 2, *words, tmp_path / "no" / "runs.db")
    assert "is no catalogue" in refused(capsys, 2, *words, folder / "a.db")
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr(catalogue_file, "_PATIENCE_S", 0.0)
    with held(tmp_path / "runs.db"):
        monkeypatch.setattr("mcap_landmarks.atomic._held", set())  # as another process has it
        assert call(*words, tmp_path / "runs.db") == 3
    assert "error: the catalogue: " in capsys.readouterr().err
    assert (tmp_path / "out" / "a.mcap").is_file()
