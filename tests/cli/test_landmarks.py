"""The verbs landmarks import, export and show."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.cli.console import DONE, UNUSABLE, USAGE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.resources import resource

from tests.maps.examples import small_map

APPENDIX_C = Path(__file__).parents[1] / "data" / "thesis_appendix_c.txt"


def run(*arguments: str | Path) -> int:
    return run_command(build("landmarks"), ["landmarks", *map(str, arguments)])


def test_appendix_c_goes_in_and_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("import", tmp_path / "m.db", APPENDIX_C) == DONE
    assert run("export", tmp_path / "m.db", tmp_path / "c.txt") == DONE
    assert (tmp_path / "c.txt").read_bytes() == APPENDIX_C.read_bytes()
    assert "60 landmarks and 20 groups" in capsys.readouterr().out


def test_the_format_may_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "m.db", small_map())
    assert run("export", tmp_path / "m.db", tmp_path / "m.dat", "--format", "JSON") == DONE
    assert run("import", tmp_path / "n.db", tmp_path / "m.dat", "--format", "json") == DONE
    assert (tmp_path / "n.db").read_bytes() == (tmp_path / "m.db").read_bytes()
    assert run("import", tmp_path / "o.db", tmp_path / "m.dat") == USAGE
    assert run("import", tmp_path / "o.db", tmp_path / "m.dat", "--format", "xml") == USAGE
    assert "choose thesis, csv, json" in capsys.readouterr().err


def test_what_a_format_leaves_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "m.db", small_map())
    assert run("export", tmp_path / "m.db", tmp_path / "m.csv") == DONE
    assert run("export", tmp_path / "m.db", tmp_path / "m.txt") == DONE
    assert capsys.readouterr().err.splitlines() == [
        "note: 1 tentative landmark left out; JSON holds all",
        "note: 1 landmark in no group left out; CSV and JSON hold all",
    ]


def test_files_are_not_replaced_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "m.db", small_map())
    assert run("import", tmp_path / "m.db", APPENDIX_C) == USAGE
    assert len(read_map(tmp_path / "m.db")) == 4
    assert "write to another file, or replace it with --overwrite" in capsys.readouterr().err
    assert run("import", tmp_path / "m.db", APPENDIX_C, "--overwrite") == DONE
    assert len(read_map(tmp_path / "m.db")) == 60


def test_bad_input_leaves_nothing_behind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.txt").write_text("[['person', 1, 2]]\n")
    assert run("import", tmp_path / "m.db", tmp_path / "bad.txt") == UNUSABLE
    assert "bad.txt, line 1: expected [['class', x, y]" in capsys.readouterr().err
    write_map(tmp_path / "n.db", replace(small_map(), groups=()))
    assert run("export", tmp_path / "n.db", tmp_path / "n.txt") == UNUSABLE
    assert run("export", tmp_path / "none.db", tmp_path / "n.txt") == UNUSABLE
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bad.txt", "n.db"]


def test_show_prints_everything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "m.db", small_map())
    assert run("show", tmp_path / "m.db") == DONE
    out = capsys.readouterr().out
    for text in (
        "4 landmarks and 2 groups in frame map",
        "38 of 40 bundles used",
        "person (tentative, movable)",
        "a b c",
    ):
        assert text in out
    assert run("show", tmp_path / "m.db", "--json") == DONE
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json.loads(resource("schemas", "json/landmarks.schema.json").read_text()))
    assert len(document["landmarks"]) == 4
