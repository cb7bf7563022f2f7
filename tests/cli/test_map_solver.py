"""`map` tells how its solver ended: in --json, in a note where it got near its limit, in an error where it failed."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.cli.calls import call, refused, schema_of
from tests.cli.logs import messages, write


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("log") / "a.mcap", messages(seed=1))


def solver(capsys: pytest.CaptureFixture[str]) -> tuple[Any, str]:
    """What the last --json document says of the solver, and what stderr says."""
    told = capsys.readouterr()
    document = json.loads(told.out)
    jsonschema.validate(document, schema_of("map"))
    return document.get("solver"), told.err


@pytest.mark.slow
def test_how_the_solver_ended_is_told_and_kept(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("map", log, "--map", tmp_path / "a.db", "--json")
    assert call(*words) == 0
    found, notes = solver(capsys)
    assert found["converged"] is True
    assert 1 < found["iterations"] < 50
    assert found["cost"] > 0
    assert "iterations" not in notes
    assert call(*words) == 0
    again, notes = solver(capsys)
    assert "build_map reused" in notes
    assert again == found


@pytest.mark.slow
def test_the_last_iteration_that_was_allowed_is_noted(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("map", log, "--map", tmp_path / "a.db", "--json") == 0
    free, _ = solver(capsys)
    limit = ("--set", f"build_map.max_iterations={free['iterations']}")
    for _ in ("built", "reused"):
        assert call("map", log, "--map", tmp_path / "b.db", "--json", *limit) == 0
        found, notes = solver(capsys)
        assert found == free
        assert f"b.db: a solution needed the last of {free['iterations']} iterations" in notes


@pytest.mark.slow
def test_a_map_that_did_not_converge_is_refused_with_what_to_try(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, 1, "map", log, "--map", tmp_path / "a.db", "--set", "build_map.max_iterations=1")
    assert "a.mcap: poses and landmarks did not converge in 1 iterations; check odometry and clocks" in line
    assert "build_map.max_iterations" in line
    assert "fewer logs" not in line
    assert not (tmp_path / "a.db").exists()
    other = write(tmp_path / "b.mcap", messages(seed=2))
    words = ("--map", tmp_path / "a.db", "--set", "build_map.max_iterations=1")
    assert "map fewer logs at once" in refused(capsys, 1, "map", log, other, *words)


def test_the_thesiss_method_has_no_solver(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", log, "--map", tmp_path / "a.db", "--json", "--method", "thesis") == 0
    assert solver(capsys)[0] is None
