"""The verb diff of two drives: that it knows them, and what it says of them."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import MAP, ODOMETRY
from mcap_landmarks.cli.console import DONE, USAGE, run_command
from mcap_landmarks.cli.diff_text import DIFFERENT
from mcap_landmarks.cli.main import build
from mcap_landmarks.diff.two_drives import are_two_drives
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource

from tests.cli.calls import schema_of
from tests.diff.recordings import LANDMARKS, START_NS, STEP_NS, localized_messages, write
from tests.diff.sets import result
from tests.evaluation.runs import one_run
from tests.evaluation.scenes import scene


def run(*arguments: str | Path) -> int:
    return run_command(build("diff"), ["diff", *map(str, arguments)])


def odometry(speed_mps: float, count: int = 40, gap: int = 0) -> list[Any]:
    """A straight drive at 10 Hz, without the messages of a gap."""
    found = []
    for i in [*range(20), *range(20 + gap, count)]:
        time_ns, x = START_NS + i * STEP_NS, speed_mps * i / 10
        pose = Odometry.planar(time_ns, ("odom", "base"), np.array([x, 0, 0]), np.eye(3), (speed_mps, 0.0))
        found.append((ODOMETRY, time_ns, pose))
    return found


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two drives of the same seconds: a slow one, and one of twice the speed with a gap and another map."""
    folder = tmp_path_factory.mktemp("drives")
    names, places = ["person", "suitcase", "bench", "car"], [[0.0, 5], [10, 5], [5, 9], [2, 2]]
    other = scene([*names[:2], *names[3:]], [*places[:2], *places[3:]], START_NS, ids=["p", "s", "c"])
    one = write(folder / "a.mcap", [(MAP, START_NS, LANDMARKS), *localized_messages(), *odometry(0.5)])
    two = write(folder / "b.mcap", [(MAP, START_NS, other), *localized_messages(), *odometry(1.0, gap=8)])
    return one, two


def test_logs_of_two_drives_are_known() -> None:
    """They begin at the same moment, as all of a simulation do, and share calibration and static transforms."""
    paths = [Path(str(resource("recordings", f"demo_{name}.mcap"))) for name in ("map", "localize")]
    with open_recording(paths[0]) as one, open_recording(paths[1]) as other:
        assert are_two_drives(one, other)
        assert are_two_drives(other, one)
        assert not are_two_drives(one, one)


def test_two_runs_of_one_drive_are_known(tmp_path: Path) -> None:
    """Also where one lacks a topic, or the results differ throughout."""
    other = one_run()
    other.entries = [entry for entry in other.entries if entry[0] is not ODOMETRY]
    paths = [one_run().write(tmp_path / "a.mcap"), other.write(tmp_path / "b.mcap", "other")]
    paths += [result(tmp_path / f"{error_m}.mcap", 3, error_m) for error_m in (0.1, 0.2)]
    later = result(tmp_path / "later.mcap", 4)
    for mine, theirs, two in (*((a, b, False) for a, b in (paths[:2], paths[2:])), (paths[2], later, True)):
        with open_recording(mine) as baseline, open_recording(theirs) as candidate:
            assert are_two_drives(baseline, candidate) == two


def test_the_document(drives: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*drives, "--json", "--drives") == DIFFERENT
    found = json.loads(capsys.readouterr().out)
    schema = schema_of("diff_drives")
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(found, schema)
    assert found["baseline"]["distance_m"] == pytest.approx(0.5 * 3.9)
    assert found["candidate"]["distance_m"] == pytest.approx(1.0 * 3.9)
    rates = found["channels"]["/odom"]
    assert (rates["baseline"]["gaps"], rates["candidate"]["gaps"]) == (0, 1)
    assert rates["candidate"]["longest_gap_s"] == pytest.approx(0.9)
    speed = found["fields"]["/odom"]["twist.twist.linear[0]"]
    assert (speed["verdict"], speed["distance"], speed["within"]) == ("different", 1, 0)
    assert found["fields"]["/ground_truth/pose"]["position_m[0]"]["verdict"] == "alike"
    assert found["classes"]["/landmarks/scene_objects"]["suitcase"]["baseline"]["per_message"] == pytest.approx(0.8)
    assert found["statuses"]["localized"]["delta"] == 0
    assert [(one["id"], one["class_name"]) for one in found["landmarks"]["came"]] == [("c", "car")]
    assert [(one["id"], one["class_name"]) for one in found["landmarks"]["went"]] == [("b", "bench")]
    assert found["metrics"]["position.rmse_m"]["delta"] == 0


def test_the_text(drives: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*drives, "--drives") == DIFFERENT
    out = capsys.readouterr().out
    for text in (
        "two drives: ",
        "/odom twist.twist.linear[0]",
        "landmarks: 2 in both, 1 came, 1 went",
        "  + car c at 2.00 m, 2.00 m",
        "/landmarks/scene_objects  per message",
    ):
        assert text in out, out


def test_what_only_one_drive_saw_of_one_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entries = [(MAP, START_NS, LANDMARKS), *localized_messages()]
    one = write(tmp_path / "a.mcap", entries)
    blind = write(tmp_path / "b.mcap", [entries[0], *(entry for entry in entries if "match" not in entry[0].topic)])
    assert run(one, blind, "--drives", "--json") == DIFFERENT
    landmarks = json.loads(capsys.readouterr().out)["landmarks"]
    assert landmarks["one_map"]
    assert [one["id"] for one in landmarks["went"]] == ["p", "s"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--fail-on", "channels./odom.gaps > 0"], DIFFERENT),
        (["--fail-on", "position.rmse_m > 5"], DONE),
        (["--fail-on", "landmarks.went > 0"], DIFFERENT),
        (["--fail-on", "channels./odom.fields.twist.twist.linear[0].distance > 0.9"], DIFFERENT),
        (["--fail-on", "landmarks.gone > 0"], USAGE),
        (["--tolerance", "/odom.position_m=1"], USAGE),
    ],
)
def test_conditions_decide_alone(words: list[str], code: int, drives: tuple[Path, Path]) -> None:
    assert run(*drives, "--drives", *words) == code


def test_what_is_damaged_is_said(drives: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(drives[1].read_bytes()[:-300])
    assert run(drives[0], cut, "--drives") == USAGE
    assert "recover the log first" in capsys.readouterr().err
    (tmp_path / "m.db").write_bytes(b"SQLite format 3\0".ljust(68, b"\0") + b"MCLM")  # a map by its id
    assert run(tmp_path / "m.db", tmp_path / "m.db", "--drives") == USAGE
    assert "maps are compared as they are" in capsys.readouterr().err
