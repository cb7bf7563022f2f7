"""Stages from the command line: what ran, what was reused, what an interruption leaves."""

import json
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, MATCH, SCENE_OBJECTS
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.runs import stage_runner
from mcap_landmarks.runs.tallies import tally

from tests.cli.calls import call
from tests.cli.logs import write
from tests.maps.examples import small_map
from tests.runs.chain import COUNT, STEP_NS, counted, raw_log, raw_messages, two_posts

FRONT = "detect,cluster,fuse"


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a log, a detector and a map."""
    raw_log(tmp_path / "log.mcap")
    two_posts(tmp_path / "model.onnx")
    write_map(tmp_path / "map.db", small_map())
    return tmp_path


def document(capsys: pytest.CaptureFixture[str], here: Path, *words: object, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert call(words[0], *words[1:], "--model", here / "model.onnx", "--json") == code
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    schema = json.loads(resource("schemas", f"json/{words[0]}.schema.json").read_text())
    jsonschema.validate(found, schema)
    return found


def count_of(path: Path, topic: str) -> int:
    with open_recording(path) as recording:
        return {entry.connection.topic: entry.count for entry in recording.channels}.get(topic, 0)


def test_stages_one_after_the_other(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, here, "run", here / "log.mcap", "--stages", FRONT, "-o", here / "out.mcap")
    assert found["stages"] == {"cluster": "ran", "detect": "ran", "fuse": "ran"}
    assert found["results"]["detect"] == {
        "bundles": COUNT,
        "unreadable": 0,
        "counts": {"fire hydrant": COUNT, "person": COUNT},
    }
    again = document(capsys, here, "run", here / "log.mcap", "--stages", FRONT, "-o", here / "out.mcap")
    assert again["stages"] == {"cluster": "reused", "detect": "reused", "fuse": "reused"}
    assert again["results"] == found["results"]
    assert again["reasons"]["detect"] == "the same results are in the earlier output"


def test_the_text_says_what_was_reused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("run", here / "log.mcap", "--stages", FRONT, "-o", here / "out.mcap", "--model", here / "model.onnx")
    assert call(*words) == 0
    assert call(*words, "--set", "fuse.bearing_gate=4") == 0
    said = capsys.readouterr().err
    assert f"{here / 'out.mcap'}: detect reused: the same results are in the earlier output" in said
    assert f"{here / 'out.mcap'}: fuse ran: bearing_gate changed since the results in the earlier output" in said


@pytest.mark.slow
def test_localize_makes_the_scene_objects_that_a_log_lacks(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("localize", here / "log.mcap", "--map", here / "map.db", "-o", here / "out.mcap")
    found = document(capsys, here, *words)
    assert set(found["stages"]) == {"cluster", "detect", "fuse", "localize"}
    assert found["bundles"] == sum(found["statuses"].values()) == COUNT
    for topic in (DETECTIONS.topic, SCENE_OBJECTS.topic, MATCH.topic):
        assert count_of(here / "out.mcap", topic) == COUNT
    assert set(document(capsys, here, *words)["stages"].values()) == {"reused"}


@pytest.mark.slow
def test_a_map_from_pixels(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    looks = counted(monkeypatch)
    words = ("map", here / "log.mcap", "--map", here / "new.db")
    found = document(capsys, here, *words)
    assert found["stages"] == dict.fromkeys(("cluster", "detect", "fuse", "build_map"), "ran")
    assert found["landmarks"] == 2
    database = (here / "new.db").read_bytes()
    again = document(capsys, here, *words)
    assert again["stages"] == dict.fromkeys(("cluster", "detect", "fuse", "build_map"), "reused")
    assert [log | {"stages": 0, "reasons": 0, "seconds": 0} for log in again["logs"]] == [
        log | {"stages": 0, "reasons": 0, "seconds": 0} for log in found["logs"]
    ]
    assert len(looks) == COUNT
    assert (here / "new.db").read_bytes() == database
    found = document(capsys, here, *words, "-o", here / "mapped.mcap")
    assert found["stages"]["build_map"] == "ran"
    assert found["logs"][0]["reasons"]["build_map"] == "an output has no results of it"
    assert count_of(here / "mapped.mcap", "/landmarks/map_pose") == COUNT
    mapped = (here / "mapped.mcap").read_bytes()
    found = document(capsys, here, *words, "-o", here / "mapped.mcap")
    assert set(found["stages"].values()) == {"reused"}
    assert (here / "mapped.mcap").read_bytes() == mapped
    assert len(looks) == 2 * COUNT
    found = document(capsys, here, *words, "-o", here / "mapped.mcap", "--set", "build_map.min_sightings=4")
    assert found["stages"] == {"cluster": "reused", "detect": "reused", "fuse": "reused", "build_map": "ran"}
    assert "min_sightings changed" in found["logs"][0]["reasons"]["build_map"]
    assert len(looks) == 2 * COUNT
    found = document(capsys, here, "localize", here / "mapped.mcap", "--map", here / "new.db", "-o", here / "o.mcap")
    assert found["stages"] == {"cluster": "reused", "detect": "reused", "fuse": "reused", "localize": "ran"}
    assert not [path.name for path in here.iterdir() if "parts" in path.name]


def test_a_map_tells_every_time_what_was_left_out(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("map", here / "log.mcap", "--map", here / "new.db", "--model", here / "model.onnx", "--image-rate", "2.5")
    notes = []
    for _ in range(2):
        assert call(*words) == 0
        notes.append([line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")])
    assert any("images left out by --image-rate (detect)" in line for line in notes[0])
    assert notes[0] == notes[1]


def test_fewer_images(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("run", here / "log.mcap", "--stages", "detect", "-o", here / "out.mcap")
    found = document(capsys, here, *words, "--image-rate", "2.5")
    assert found["dropped"] == {"images left out by --image-rate": COUNT // 2}
    assert count_of(here / "out.mcap", DETECTIONS.topic) == COUNT // 2
    found = document(capsys, here, *words, "--every", "0.05m,5deg")
    assert found["dropped"] == {"images left out by --every": COUNT - 3}
    assert found["reasons"]["detect"].startswith("the option every_m, every_rad, image_rate_hz changed")
    for wrong in (("--every", "5"), ("--every", "0m"), ("--every", "far m"), ("--image-rate", "0")):
        assert call(*words, *wrong, "--model", here / "model.onnx") == 2


def test_an_interruption_leaves_finished_stages(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, out, seen = counted(monkeypatch), here / "out.mcap", [0]

    def interrupting(message: Message) -> Mapping[str, int]:
        seen[0] += 1
        if seen[0] == 5 * COUNT - 2:  # the results of cluster, two for every image of detect, some of fuse
            signal.raise_signal(signal.SIGINT)
        return tally(message)

    monkeypatch.setattr(stage_runner, "tally", interrupting)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts background jobs without it
    words = ("run", here / "log.mcap", "--stages", FRONT, "-o", out)
    assert call(*words, "--model", here / "model.onnx") == 130
    assert not out.exists()
    parts = sorted(path.name.partition("-")[0] for path in (here / ".out.mcap.parts").iterdir())
    assert parts == ["cluster", "detect"]
    assert "interrupted" in capsys.readouterr().err
    found = document(capsys, here, *words)
    assert found["stages"] == {"cluster": "reused", "detect": "reused", "fuse": "ran"}
    assert len(looks) == COUNT
    assert not (here / ".out.mcap.parts").exists()


@pytest.mark.slow
def test_several_logs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    raw_log(here / "other.mcap", COUNT - 2)
    logs = (here / "log.mcap", here / "other.mcap")
    found = document(capsys, here, "run", *logs, "--stages", "detect", "-o", here / "out", "--end", 4 * STEP_NS)
    assert [log["results"]["detect"]["bundles"] for log in found["logs"]] == [3, 3]
    found = document(capsys, here, "map", *logs, "--map", here / "both.db")
    assert [log["bundles"] for log in found["logs"]] == [COUNT, COUNT - 2]


def test_wrong_usage(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images = [stamped for stamped in raw_messages() if stamped.channel == CAMERA_IMAGE]
    blind, out = write(here / "blind.mcap", images), here / "out.mcap"
    for said, words in (
        ("--stages names none", ("--stages", " ,")),
        ("clusta is no stage", ("--stages", "clusta")),
        ("localize needs a map", ("--stages", "localize")),
        ("--every needs odometry", ("--stages", "detect", "--every", "1m", "--model", here / "model.onnx")),
    ):
        capsys.readouterr()
        assert call("run", blind, "-o", out, *words) == 2
        assert said in capsys.readouterr().err
        assert not out.exists()


def test_a_span_beside_the_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = resource("recordings", "demo_localize.mcap")
    for words in (["--end", "1700000060000000000"], ["--start", "1900000000000000000"]):
        assert call("run", log, "--stages", "cluster", "-o", tmp_path / "out.mcap", *words) == 2
        told = capsys.readouterr().err
        assert "no message lies between --start and --end; the log lasts from 2026-01-01T00:00:" in told
