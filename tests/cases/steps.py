"""What cases.toml expects of the steps of a case: run in process, and every fact looked at."""

import json
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.cli.calls import call
from tests.shared import data_folder

RECORDINGS = Path(__file__).parents[2] / "recordings"


def cases_folder() -> Path:
    """`cases` beside the data that others made."""
    data = data_folder()
    return (data.parent if data is not None else Path(__file__).resolve().parents[3] / "shared") / "cases"


@cache
def _cases() -> dict[str, dict[str, Any]]:
    found = tomllib.loads((cases_folder() / "cases.toml").read_text())
    return {case["name"]: case for case in found["case"]}


def check_case(
    name: str, folder: Path, site: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Run the steps of a case in the folder of its input; where it may be refused, the refusal is as good."""
    monkeypatch.chdir(folder)
    for step in _cases()[name]["step"]:
        words = [word.replace("{site}", str(site)) for word in step["run"].split()]
        capsys.readouterr()
        code = call(*words)
        said = "".join(capsys.readouterr())
        allowed = step.get("exit", [0, 3] if words[0] == "info" else 0)
        if code not in (allowed if isinstance(allowed, list) else [allowed]):
            assert "refusal" in step, said
            assert re.search(step["refusal"], said), said
            assert code in (1, 2)
            continue
        _check_words(step, said)
        if "landmarks" in step:
            _check_map(step, words[words.index("--map") + 1], capsys)
        if {"localized", "rmse_m", "nees"} & {*step}:
            _check_figures(step, words[words.index("-o") + 1], capsys)


def _check_words(step: dict[str, Any], said: str) -> None:
    warned = "\n".join(re.findall(r"(?m)^(?:problem|warning|error).*", said))
    assert all(re.search(pattern, said) for pattern in step.get("says", ())), said
    assert all(re.search(pattern, warned) for pattern in step.get("warns", ())), said
    assert not any(re.search(pattern, said) for pattern in step.get("never", ())), said


def _check_map(step: dict[str, Any], database: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("evaluate", database, "--json", "--reference", RECORDINGS / "demo_map.mcap") == 0
    found = json.loads(capsys.readouterr().out)["map"]
    assert found["landmarks"] == step["landmarks"], found
    assert (found["missing"], found["spurious"]) == (step.get("missing", 0), step.get("spurious", 0))
    assert found["rmse_aligned_m"] <= step.get("map_rmse_m", 0.1)


def _check_figures(step: dict[str, Any], output: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("evaluate", output, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["localized"] >= step.get("localized", 0.0) * found["bundles"], found
    assert found["position"]["rmse_m"] <= step.get("rmse_m", 1.0), found
    assert found["nees"] <= step.get("nees", 10.0), found
    assert found["false"]["count"] == 0
