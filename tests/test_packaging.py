"""The names that an installation brings: two packages, and nothing that another folder could stand in the way of."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import mcap_landmarks
import mcap_landmarks_generator

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())


def test_both_packages_say_that_they_are_typed() -> None:
    for package in (mcap_landmarks, mcap_landmarks_generator):
        assert (Path(package.__path__[0]) / "py.typed").is_file()


def test_no_extra_is_empty() -> None:
    assert all(PROJECT["project"]["optional-dependencies"].values())


def test_folders_named_toolkit_and_generator_do_not_stand_in_the_way(tmp_path: Path) -> None:
    """A ROS shell puts workspaces on PYTHONPATH, and one may have folders of these names."""
    for name in ("toolkit", "generator", "stages", "sources"):
        (tmp_path / name).mkdir()
    paths = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    run = subprocess.run(
        [sys.executable, "-m", "mcap_landmarks", "--version"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout.strip()) == (0, f"mcap-landmarks {mcap_landmarks.__version__}"), run.stderr
