"""The verb generate."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.cli.console import DONE, UNUSABLE, USAGE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.resources import resource

SCENE = """\
seed = 3
objects = [ { class = "fire hydrant", at = [1.2, 0.0], look = 1 } ]
[camera]
width_px = 64
height_px = 48
[trajectory]
waypoints = [ { at = [0.0, 0.0], stop_s = 0.6 } ]
"""


def run(*arguments: str | Path) -> int:
    return run_command(build("generate"), ["generate", *map(str, arguments)])


def validated(text: str) -> dict[str, object]:
    document: dict[str, object] = json.loads(text)
    jsonschema.validate(document, json.loads(resource("schemas", "json/generate.schema.json").read_text()))
    return document


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def test_writes_a_recording_and_says_what_is_in_it(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = scene.with_name("log.mcap")
    assert run(scene, "-o", target, "--workers", "1", "--json", "--seed", "7", "--set", "camera.rate_hz=5") == DONE
    document = validated(capsys.readouterr().out)
    assert document["seed"] == 7
    assert document["collisions"] == []
    topics = document["topics"]
    assert isinstance(topics, Mapping)
    assert topics["/camera/image_raw/compressed"] in (3, 4)
    assert target.is_file()


def test_text_output_names_the_file(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(scene, "-o", scene.with_name("log.mcap"), "--workers", "1", "--set", "camera.when=never") == DONE
    assert "log.mcap: 0.7" in capsys.readouterr().out


@pytest.mark.slow
def test_info_finds_every_role(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = scene.with_name("log.mcap")
    run(scene, "-o", target, "--workers", "1")
    capsys.readouterr()
    assert run_command(build("info"), ["info", str(target), "--json"]) == DONE
    roles = json.loads(capsys.readouterr().out)["roles"]
    assert all(roles[role] for role in ("image", "camera_info", "scan", "odometry", "truth"))


def test_lists_the_bundled_scenarios(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--list", "--json") == DONE
    assert "thesis_map" in json.dumps(validated(capsys.readouterr().out))
    assert run("--list") == DONE
    assert capsys.readouterr().out.startswith("campus ")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), USAGE, "name a scenario"),
        (("small",), USAGE, "name a scenario"),
        (("smal", "-o", "x.mcap"), USAGE, "did you mean small"),
        (("small", "-o", "missing/x.mcap"), USAGE, "does not exist"),
        (("small", "-o", "x.mcap", "--set", "seed"), USAGE, "--set seed: write KEY=VALUE"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], code: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*arguments) == code
    assert message in capsys.readouterr().err


def test_a_bad_scenario_is_refused_in_one_line(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(SCENE.replace("fire hydrant", "dragon"))
    assert run(scene, "-o", scene.with_name("log.mcap")) == UNUSABLE
    error = capsys.readouterr().err
    assert f"{scene}:2: objects.0.class = 'dragon'" in error
    assert error.count("\n") == 1
    assert not scene.with_name("log.mcap").exists()


@pytest.mark.slow
def test_without_pybullet_it_says_what_to_install(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in [name for name in sys.modules if name.startswith("mcap_landmarks_generator")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "pybullet", None)  # so that importing it fails
    assert run(scene, "-o", scene.with_name("log.mcap")) == UNUSABLE
    assert "pip install 'mcap-landmarks[generator]'" in capsys.readouterr().err


@pytest.mark.slow
def test_stdout_is_only_json(scene: Path) -> None:
    """PyBullet prints from C, past Python's streams."""
    command = [sys.executable, "-c", "from mcap_landmarks.cli.main import run; run()", "generate", str(scene)]
    options = ["-o", str(scene.with_name("log.mcap")), "--workers", "1", "--json", "--set", "camera.when=never"]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=True)
    validated(done.stdout)
