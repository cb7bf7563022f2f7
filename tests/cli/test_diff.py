"""The verb diff: exit codes, text, and the document."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import MAP, POSE, TRUTH_OBJECTS
from mcap_landmarks.cli.console import DONE, USAGE, run_command
from mcap_landmarks.cli.diff_text import DIFFERENT
from mcap_landmarks.cli.main import build
from mcap_landmarks.diff.maps import moved
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.resources import resource

from tests.diff.recordings import LANDMARKS, START_NS, localized_log, localized_messages, write
from tests.evaluation.runs import BUNDLES, one_run, without
from tests.maps.examples import small_map

DETECTION = ("ids", "hypotheses", "boxes_xyxy")


def run(*arguments: str | Path) -> int:
    return run_command(build("diff"), ["diff", *map(str, arguments)])


def document(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> dict[str, Any]:
    capsys.readouterr()
    assert run(*arguments, "--json") in {DONE, DIFFERENT}
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json.loads(resource("schemas", "json/diff.schema.json").read_text()))
    return found


@pytest.fixture
def logs(tmp_path: Path) -> tuple[Path, Path]:
    """A run, and one with another setting that lost a detection and a pose and moved another pose."""
    other = one_run()
    other.config = {"detect": {"confidence": 0.5}}
    other.edit("/landmarks/detections", lambda m: without(m, 0, DETECTION), 1)
    other.edit("/landmarks/pose", lambda m: PoseStamped.planar(m.stamp_ns, "map", m.pose + 0.25), 3)
    other.entries.pop(other.index("/landmarks/pose", 4))
    return one_run().write(tmp_path / "a.mcap"), other.write(tmp_path / "b.mcap")


@pytest.fixture
def measured(tmp_path: Path) -> tuple[Path, Path]:
    """A run with truth, and one whose second pose is half a metre off."""
    entries = [(MAP, START_NS, LANDMARKS), (TRUTH_OBJECTS, START_NS, LANDMARKS), *localized_messages()]
    place = [i for i, entry in enumerate(entries) if entry[0] == POSE][1]
    channel, time_ns, pose = entries[place]
    assert isinstance(pose, PoseStamped)
    entries[place] = channel, time_ns, PoseStamped.planar(pose.stamp_ns, "map", pose.pose + np.array([0.5, 0, 0]))
    return localized_log(tmp_path / "c.mcap"), write(tmp_path / "d.mcap", entries)


def test_the_text_names_what_changed(logs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*logs) == DIFFERENT
    out = capsys.readouterr().out
    for text in (
        "different: 2 of 15 channels",
        "config.detect.confidence",
        "messages /landmarks/pose",
        "removed: 1 (person 1)",
        "2023-11-14T22:13:20.100000000Z person: score 0.9",
        "position_m: 1 changed, by 0.353553 m at most",
        "orientation: 1 changed, by 14.3239 deg at most",
        " -> heading ",
    ):
        assert text in out, text


def test_the_document(logs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    schema = json.loads(resource("schemas", "json/diff.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    found = document(capsys, *logs)
    assert found["verdict"] == "different"
    assert found["channels"]["/landmarks/pose"]["removed"] == 1
    assert document(capsys, logs[0], logs[0])["identical"]
    write_map(tmp_path / "map.db", small_map())
    assert document(capsys, tmp_path / "map.db", tmp_path / "map.db", "--align")["alignment"] is not None


def test_the_same_is_zero(logs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(logs[0], logs[0]) == DONE
    assert "equal byte by byte" in capsys.readouterr().out
    assert run(logs[0], one_run().write(tmp_path / "same.mcap", "other")) == DONE
    assert "same: 15 channels, nothing beyond tolerance" in capsys.readouterr().out


def test_metrics_tell_whether_it_is_better(measured: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    rows = document(capsys, *measured)["metrics"]
    assert rows["position.rmse_m"]["delta"] > 0
    assert rows["localized"] == {"baseline": 3, "candidate": 3, "delta": 0}
    assert run(*measured) == DIFFERENT
    assert "position.rmse_m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("conditions", "code"),
    [
        (["position.rmse_m > 0.05"], DIFFERENT),
        (["position.rmse_m > 5"], DONE),
        (["delta.position.median_m <= 0"], DONE),
        (["delta.position.median_m <= 0", "delta.position.median_m>0"], DIFFERENT),
        (["baseline.localized != 3"], DONE),
        (["channels./landmarks/pose.changed >= 1"], DIFFERENT),
        (["channels./landmarks/pose.removed > 0"], DONE),
        (["channels./landmarks/pose.fields.position_m.largest > 0.4"], DIFFERENT),
        (["channels./landmarks/pose.fields.orientation.largest > 0"], DONE),
        (["removed > 1e-3"], DONE),
        (["statuses.no_match > 0"], DONE),
    ],
)
def test_conditions_decide_alone(conditions: list[str], code: int, measured: tuple[Path, Path]) -> None:
    assert run(*measured, *(word for text in conditions for word in ("--fail-on", text))) == code


def test_conditions_hold_for_equal_files_too(measured: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(measured[0], measured[0], "--fail-on", "position.rmse_m > 0.05") == DIFFERENT
    assert "fails: position.rmse_m > 0.05" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fail-on", "position.rmsem > 1"], "did you mean position.rmse_m?"),
        (["--fail-on", "position.rmse_m > 1"], "unknown here; metrics need the truth"),
        (["--fail-on", "channels./landmarks/pos.removed > 1"], "did you mean channels./landmarks/pose.removed?"),
        (["--fail-on", "__import__('os')"], "write NAME > NUMBER"),
        (["--fail-on", "removed > nan"], "write NAME > NUMBER"),
        (["--fail-on", "removed > few"], "write NAME > NUMBER"),
        (["--tolerance", "/landmarks/pose.position=1"], "did you mean position_m?"),
        (["--tolerance", "/landmarks/poses.position_m=1"], "did you mean /landmarks/pose?"),
        (["--tolerance", "/landmarks/pose.position_m"], "write CHANNEL.FIELD=VALUE"),
        (["--tolerance", "/landmarks/pose.position_m=-1"], "write CHANNEL.FIELD=VALUE"),
        (["--align"], "--align moves landmark databases"),
    ],
)
def test_wrong_words_are_answered(
    arguments: list[str], words: str, logs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*logs, *arguments) == USAGE
    assert words in capsys.readouterr().err


def test_every_error_is_two(logs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "map.db", small_map())
    (tmp_path / "text.mcap").write_text("no recording")
    for other in ("none.mcap", "map.db", "text.mcap", "none.db"):
        assert run(logs[0], tmp_path / other) == USAGE
        assert capsys.readouterr().err.startswith("error: ")
    assert run(logs[0]) == USAGE
    logs[1].write_bytes(logs[1].read_bytes()[:-300])
    assert run(*logs) == USAGE
    assert "was not compared; recover the log first" in capsys.readouterr().err


def test_a_note_where_nothing_belongs_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "a.db", small_map())
    write_map(tmp_path / "b.db", moved(small_map(), np.array([100.0, 0, 0])))
    assert run(tmp_path / "a.db", tmp_path / "b.db") == DIFFERENT
    assert "nothing of the one has its like in the other; try --align" in capsys.readouterr().err
    assert run(tmp_path / "a.db", tmp_path / "b.db", "--align") == DONE


def test_tolerances(logs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    wide = ("--tolerance", "/landmarks/pose.position_m=1", "--tolerance", "/landmarks/pose.orientation=1")
    channel = document(capsys, *logs, *wide)["channels"]["/landmarks/pose"]
    assert (channel["same"], channel["changed"], channel["removed"]) == (BUNDLES - 1, 0, 1)
