"""The verb evaluate."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import POSE, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, USAGE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.resources import resource

from tests.diff.recordings import START_NS, localized_log, localized_messages, write
from tests.maps.examples import small_map

DATA = Path(__file__).parents[1] / "data"


def run(*arguments: str | Path) -> int:
    return run_command(build("evaluate"), ["evaluate", *map(str, arguments)])


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return localized_log(tmp_path / "r.mcap")


def document(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> dict[str, Any]:
    assert run(*arguments, "--json") == DONE
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json.loads(resource("schemas", "json/evaluate.schema.json").read_text()))
    return found


def test_the_document_fits_its_schema(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(
        json.loads(resource("schemas", "json/evaluate.schema.json").read_text())
    )
    assert document(capsys, log)["alignment"] is None
    assert document(capsys, log, "--align", "--association", "nearest")["alignment"] is not None
    assert document(capsys, DATA / "thesis_appendix_d.txt")["position"]["rmse_m"] == pytest.approx(0.1059, abs=5e-5)
    write_map(tmp_path / "map.db", small_map())
    assert document(capsys, tmp_path / "map.db", "--reference", log)["map"]["landmarks"] == 3


def test_poses_in_a_frame_of_their_own_are_told_how_to_be_measured(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = tmp_path / "elsewhere.tum"
    seconds = START_NS // 10**9
    truth.write_text(
        "".join(f"{seconds + tenths / 10:.3f} 40 {tenths / 100} 0 0 0 0 1\n" for tenths in range(-20, 200))
    )
    assert run(log, "--reference", truth) == DONE
    assert "--align moves them onto the truth" in capsys.readouterr().err
    assert run(log) == DONE
    assert "--align" not in capsys.readouterr().err


def test_the_table_tells_units_and_cases(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(log, "--align") == DONE
    out = capsys.readouterr().out
    for text in (
        "localized",
        "75.0 % of eligible",
        " of scored",
        "status ambiguous",
        "after one SE(2) fit",
        " deg",
    ):
        assert text in out


def test_a_robot_that_stands_is_aligned_by_headings_or_not_at_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = [START_NS + i * 10**8 for i in range(20)]
    spot = np.array([2.0, 1.0, 2.0])
    off = np.random.default_rng(0).normal(0, [0.01, 0.01, 0.001], (20, 3))
    truth = [(TRUTH_POSE, time_ns, PoseStamped.planar(time_ns, "map", np.zeros(3))) for time_ns in times]
    found = [(POSE, t, PoseStamped.planar(t, "map", spot + error)) for t, error in zip(times, off, strict=True)]
    log = write(tmp_path / "stands.mcap", [*truth, *found])
    told = document(capsys, log, "--align")
    assert told["alignment"]["rotation_from"] == "headings"
    assert told["heading"]["rmse_deg"] < 0.1
    assert run(log, "--align") == DONE
    assert "headings, sigma 0.01" in capsys.readouterr().out
    bare = [(POSE, pose.stamp_ns, replace(pose, orientation_xyzw=np.zeros(4))) for _, _, pose in found]
    assert run(write(tmp_path / "bare.mcap", [*truth, *bare]), "--align") == USAGE
    assert "bare.mcap: the 20 poses hardly move" in capsys.readouterr().err


def test_exports_come_back_as_reference(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(log, "--tum", tmp_path / "e.tum", "--thesis", tmp_path / "e.txt") == DONE
    capsys.readouterr()
    assert document(capsys, log, "--reference", tmp_path / "e.tum")["position"]["max_m"] == pytest.approx(0, abs=1e-9)
    assert document(capsys, tmp_path / "e.txt")["scored"] == 3


def test_truth_may_come_from_another_log(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blind = write(tmp_path / "b.mcap", [entry for entry in localized_messages() if entry[0] != TRUTH_POSE])
    assert run(blind) == USAGE
    assert "holds no truth; name a log or a TUM trajectory that has it with --reference" in capsys.readouterr().err
    assert document(capsys, blind, "--reference", log)["scored"] == 3


def test_poses_without_truth_near_them_are_told(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "old.tum").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    assert run(log, "--reference", tmp_path / "old.tum") == DONE
    assert "no pose has a truth near enough in time" in capsys.readouterr().err


def test_nothing_to_evaluate(tmp_path: Path, log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = write(tmp_path / "t.mcap", [e for e in localized_messages() if e[0] in {TRUTH_POSE, TRUTH_OBJECTS}])
    assert run(truth) == UNUSABLE
    assert "has no results to evaluate; run localize on it first" in capsys.readouterr().err
    assert run(tmp_path / "none.mcap") == UNUSABLE
    write_map(tmp_path / "map.db", small_map())
    assert run(tmp_path / "map.db") == USAGE
    assert run(tmp_path / "map.db", "--reference", truth) == USAGE
    assert "a map is measured against objects" in capsys.readouterr().err
    assert run(log, "--association", "guess") == USAGE


def test_a_damaged_log_is_said_to_be_one(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log.write_bytes(log.read_bytes()[:-200])
    assert run(log) == PARTIAL
    assert "warning: " in capsys.readouterr().err
