"""The package of docs/extending.md works as it stands there, and broken ones break nothing but themselves."""

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mcap_landmarks as ml
import numpy as np
import pytest
from mcap_landmarks import extensions
from mcap_landmarks.channels import SCENE_OBJECTS
from mcap_landmarks.cli.console import DONE, UNUSABLE, USAGE
from mcap_landmarks.cli.run import _stages_help
from mcap_landmarks.messages.images import Image
from mcap_landmarks.runs.config_text import json_schema
from mcap_landmarks.stage import Channel

from tests.cli.calls import call, refused, topics
from tests.diff.recordings import START_NS, STEP_NS, write
from tests.docs.documents import files_in
from tests.evaluation.scenes import scene
from tests.vision.networks import answering

EXAMPLE = files_in("extending.md")


def install(folder: Path, files: Mapping[str, str]) -> None:
    """What pip makes of a package's files, as far as anyone looks at it later."""
    project = tomllib.loads(files["pyproject.toml"])["project"]
    about = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    groups = "".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    )
    written = {
        **{name: text for name, text in files.items() if name != "pyproject.toml"},
        f"{about.name}/METADATA": f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n",
        f"{about.name}/entry_points.txt": groups,
    }
    written[f"{about.name}/RECORD"] = "".join(f"{name},,\n" for name in written)
    for name, text in written.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@contextmanager
def installed(folder: Path) -> Iterator[Path]:
    """Python as if the folder's packages were installed."""

    def forget() -> None:
        extensions._entries.cache_clear()
        extensions._code.cache_clear()
        for name in [name for name in sys.modules if name.startswith("landmarks_extras")]:
            del sys.modules[name]

    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setattr(sys, "dont_write_bytecode", True)
        forget()
        yield folder
    forget()


def scenes(path: Path) -> Path:
    names = ["person", "car"]
    stamps = [START_NS + i * STEP_NS for i in range(3)]
    return write(path, [(SCENE_OBJECTS, ns, scene(names, [[3.0, 0], [0, 4 + i]], ns)) for i, ns in enumerate(stamps)])


@pytest.fixture
def packages(tmp_path: Path) -> Iterator[Path]:
    install(tmp_path / "packages", EXAMPLE)
    with installed(tmp_path / "packages") as folder:
        yield folder


def shown(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    """The document that a verb prints."""
    capsys.readouterr()
    assert call(*words, "--json") == DONE
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
def test_another_process_finds_the_stage(tmp_path: Path) -> None:
    install(tmp_path / "packages", EXAMPLE)
    path = os.pathsep.join([str(tmp_path / "packages"), os.environ.get("PYTHONPATH", "")])
    words = ["run", scenes(tmp_path / "log.mcap"), "--stages", "nearest", "-o", tmp_path / "out.mcap"]
    command = [sys.executable, "-m", "mcap_landmarks", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == DONE, done.stderr
    assert topics(tmp_path / "out.mcap")["/landmarks/nearest"] == 3


def test_the_stage_is_listed_and_configured_like_ours(packages: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del packages
    assert _stages_help().endswith("localize; installed are nearest.")
    config = shown(capsys, "config", "show", "--set", "nearest.within_m=5", "--method", "thesis")["config"]
    assert config["nearest"] == {"within_m": 5.0}
    assert config["poses_csv"] == {"frame_id": "odom"}
    assert "Objects farther away" in json_schema()["properties"]["nearest"]["description"]
    complaint = refused(capsys, USAGE, "config", "show", "--set", "nearest.whithin_m=5")
    assert "did you mean within_m" in complaint


def test_its_results_are_reused_as_long_as_the_package_stays(
    packages: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = scenes(tmp_path / "log.mcap"), tmp_path / "out.mcap"
    states = []
    for change in ("", "", "# another line\n"):
        with (packages / "landmarks_extras" / "nearest.py").open("a") as file:
            file.write(change)
        with installed(packages):
            told = shown(capsys, "run", log, "--stages", "nearest", "-o", output)
        states.append((told["stages"]["nearest"], told["reasons"]["nearest"].partition(" since")[0]))
    assert states[0] == ("ran", "there were no results")
    assert states[1][0] == "reused"
    assert states[2] == ("ran", "the program changed")
    with ml.open_log(output) as found:
        assert found.poses("/landmarks/nearest")["x_m"].tolist() == [3.0, 3.0, 3.0]


def test_the_detectors_are_used_like_ours(packages: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    next(packages.glob("*.dist-info/RECORD")).unlink()  # as where a package is installed to be edited
    rows = np.array([[8, 8, 40, 40, 0.9, 1], [8, 8, 40, 40, 0.1, 0]], dtype=np.float32)
    answering(tmp_path / "m.onnx", {"corners": rows}, {"names": "['person', 'car']"})
    image = Image(START_NS, "camera", 64, 64, "rgb8", False, 192, bytes(64 * 192))
    log = write(tmp_path / "log.mcap", [(Channel("/image", Image), START_NS, image)])
    words = ("detect", log, "--model", tmp_path / "m.onnx", "-o", tmp_path / "out.mcap")
    assert shown(capsys, *words)["classes"] == {"car": 1}
    assert shown(capsys, *words)["stages"]["detect"] == "reused"
    with (packages / "landmarks_extras" / "corners.py").open("a") as file:
        file.write("\n")
    with installed(packages):
        assert shown(capsys, *words)["stages"]["detect"] == "ran"


def test_the_source_is_used_like_ours(packages: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del packages
    (tmp_path / "drive.poses.csv").write_text("2000000000,1,0,0\n1000000000,0,0,0\n")
    told = shown(capsys, "convert", tmp_path / "drive.poses.csv", "-o", tmp_path / "drive.mcap")
    assert told["outputs"][0]["topics"] == {"/odom": 2}


BROKEN = """
[project]
name = "broken"
version = "2.0"

[project.entry-points."mcap_landmarks.stages"]
detect = "nowhere:STAGE"
lost = "nowhere:STAGE"
odd = "json:dumps"

[project.entry-points."mcap_landmarks.detectors"]
worse = "nowhere:FAMILY"

[project.entry-points."mcap_landmarks.sources"]
bad = "json:loads"
"""


TOLD = {
    "detect": "(mcap_landmarks.stages) of broken 2.0: there is a detect of ours; repair or uninstall the package",
    "lost": "of broken 2.0 cannot be loaded (ModuleNotFoundError: No module named 'nowhere'); repair",
    "odd": "entry point odd = json:dumps (mcap_landmarks.stages) of broken 2.0 is of type function and no stage",
    "bad": "of broken 2.0 is of type function and no source",
}


def test_a_broken_package_breaks_only_what_asks_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(tmp_path / "packages", {"pyproject.toml": BROKEN})
    log, output = scenes(tmp_path / "log.mcap"), tmp_path / "out.mcap"
    with installed(tmp_path / "packages"):
        assert call("config", "show") == DONE
        listed = capsys.readouterr()
        assert ("[lost]" in listed.out, "[detect]" in listed.out) == (False, True)
        assert all(words in listed.err for words in TOLD.values())
        for name in ("detect", "lost", "odd"):
            assert TOLD[name] in refused(capsys, UNUSABLE, "run", log, "--stages", name, "-o", output)
        assert TOLD["lost"] in refused(capsys, UNUSABLE, "config", "show", "--set", "lost.a=1")
        assert "map" in shown(capsys, "info", log)["missing"]
        (tmp_path / "nothing.txt").touch()
        assert TOLD["bad"] in refused(capsys, UNUSABLE, "info", tmp_path / "nothing.txt")


def test_two_packages_with_one_name_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(tmp_path / "packages", EXAMPLE)
    other = EXAMPLE["pyproject.toml"].replace('"landmarks-extras"', '"other"')
    install(tmp_path / "packages", {"pyproject.toml": other})
    log = scenes(tmp_path / "log.mcap")
    with installed(tmp_path / "packages"):
        words = refused(capsys, UNUSABLE, "run", log, "--stages", "nearest", "-o", tmp_path / "out.mcap")
    assert "of landmarks-extras 1.0 and the entry point nearest" in words
    assert "of other 1.0: both are called nearest; uninstall one of them" in words


def test_a_configuration_needs_defaults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "landmarks_extras/nearest.py"
    files = {**EXAMPLE, name: EXAMPLE[name].replace("within_m: float = 10.0", "within_m: float")}
    install(tmp_path / "packages", files)
    with installed(tmp_path / "packages"):
        words = refused(capsys, UNUSABLE, "config", "show", "--set", "nearest.within_m=5")
    assert "has a setting without a default, within_m" in words
