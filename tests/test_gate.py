"""The gate of the benchmarks: what belongs into the baseline, what falls behind it, and how it is renewed."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.benchmark import all as every
from tests.benchmark.gate import Entry, as_json, entries, from_json, hold
from tests.benchmark.kept import Kept
from tests.benchmark.rows import Row

HERE, ELSEWHERE = "a processor, 2 cores", "another one, 64 cores"
ERROR = Row("error", 0.02, "m", at_most=0.05)
SHARE = Row("share", 0.98, at_least=0.9)
HONEST = Row("nees", 1.02, at_least=0.9, at_most=1.1)
FALSE = Row("false", 0, at_most=0)
SPEED = Row("speed", 100.0, "x", at_least=50)
TIME = Row("time", 3.0, "s", at_most=5)
ROWS = (ERROR, SHARE, HONEST, FALSE, SPEED, TIME)


def documents(*rows: Row) -> list[dict[str, Any]]:
    return [row.as_json() for row in rows]


def baseline(*rows: Row, where: str = HERE) -> dict[str, Entry]:
    return entries(documents(*rows), where)


def test_what_belongs_into_a_baseline() -> None:
    named = Row("read_small", 9.4, "x mcap", at_least=6)
    found = baseline(*ROWS, named, Row("triangles", 7.0), Row("median", 0.1, "m"), Row("speed-up", 3.0, "x real time"))
    assert {name: entry.better for name, entry in found.items()} == {
        "error": "lower",
        "share": "higher",
        "nees": 1.0,
        "false": "lower",
        "speed": "higher",
        "read_small": "higher",
        "median": "lower",
    }
    assert [name for name, entry in found.items() if entry.speed] == ["speed", "read_small"]
    assert from_json(json.loads(json.dumps(as_json({"x": found})))) == {"x": found}


@pytest.mark.parametrize(
    ("row", "same", "worse", "better"),
    [
        (ERROR, 0.0201, 0.0203, 0.019),
        (SHARE, 0.975, 0.965, 0.995),
        (HONEST, 0.975, 0.965, 1.001),
        (HONEST, 1.025, 1.035, 0.999),
        (FALSE, 0, 1, None),
        (SPEED, 90.0, 80.0, 120.0),
        (ERROR, 0.02, float("nan"), None),
    ],
)
def test_worse_than_noise_falls_behind(row: Row, same: float, worse: float, better: float | None) -> None:
    def held(value: float) -> tuple[list[str], list[str]]:
        document = {**row.as_json(), "value": value}
        found = hold("bench", [document], baseline(row), HERE)
        return found.behind, found.lines

    assert held(same) == ([], [])
    behind, (line,) = held(worse)
    assert behind == [row.name]
    assert line.endswith("FALLS BEHIND")
    if better is not None:
        behind, (line,) = held(better)
        assert behind == []
        assert line.endswith("better")


def test_speeds_of_another_machine_are_told_and_not_held_to() -> None:
    slow, wrong = Row("speed", 10.0, "x", at_least=50), Row("error", 0.04, "m", at_most=0.05)
    found = hold("bench", documents(slow, wrong), baseline(SPEED, ERROR, where=ELSEWHERE), HERE)
    assert found.behind == ["error"]
    assert found.lines[0] == f"bench: speed was 100 and is 10: measured on {ELSEWHERE}"


def test_new_and_missing_rows_are_told() -> None:
    found = hold("bench", documents(ERROR), baseline(SHARE), HERE)
    assert found.behind == []
    assert found.lines == ["bench: error is new: 0.02", "bench: share is missing"]


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file that has the results of `diff` and `whole` already, and a baseline of other ones."""
    monkeypatch.setattr(every, "BASELINE", tmp_path / "baseline.json")
    monkeypatch.setattr(every, "machine", lambda: HERE)
    file = tmp_path / "results"
    Kept.of(file).add("diff --quick", documents(ERROR, FALSE))
    Kept.of(file).add("whole --quick", documents(SHARE))
    older = {"diff": baseline(Row("error", 0.01, "m", at_most=0.05)), "whole": baseline(SHARE)}
    (tmp_path / "baseline.json").write_text(json.dumps(as_json(older)))
    return file


def test_the_gate_fails_and_says_how_to_renew(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--quick", "--only", "diff,whole", "--resume", str(results)]
    assert every.main([*words, "--gate"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "diff: error was 0.01 and is 0.02: FALLS BEHIND"
    assert "whole: as it was" in said
    assert "--renew --only diff," in said[-1]
    assert every.main([*words, "--renew"]) == 0
    assert every.main([*words, "--gate", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == documents(ERROR, FALSE, SHARE)


def test_renewing_one_keeps_the_others(results: Path) -> None:
    assert every.main(["--quick", "--only", "diff", "--resume", str(results), "--renew"]) == 0
    found = from_json(json.loads(every.BASELINE.read_text()))
    assert found == {"diff": baseline(ERROR, FALSE), "whole": baseline(SHARE)}


def test_results_of_other_sources_do_not_count(results: Path) -> None:
    assert {*Kept.of(results).known} == {"diff --quick", "whole --quick"}
    results.write_text(results.read_text().replace('"of": "', '"of": "another state than '))
    assert Kept.of(results).known == {}


def test_a_benchmark_that_fails_is_named(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(every, "ROOT", results.parent)
    folder = results.parent / "tests/benchmark"
    folder.mkdir(parents=True)
    (folder / "thesis.py").write_text("raise SystemExit(1)")
    (folder / "matching.py").write_text(f"import sys\nprint({json.dumps(json.dumps(documents(SHARE)))})\nsys.exit(1)")
    words = ["--quick", "--only", "thesis,matching", "--resume", str(results)]
    assert every.main(words) == 1
    assert capsys.readouterr().err.splitlines()[-1] == "thesis FAILED"
    assert Kept.of(results).known["matching --quick"] == documents(SHARE)


@pytest.mark.parametrize("words", [["--gate"], ["--renew"], ["--quick", "--only", "nothing"]])
def test_wrong_use(words: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        every.main(words)
    assert stop.value.code == 2


def test_mutants_run_only_when_named() -> None:
    assert {"accuracy", "matching", "mutants"} <= {*every.benchmarks()}
    assert "all" not in every.benchmarks()
    assert "mutants" not in every._arguments(["--quick"]).only
