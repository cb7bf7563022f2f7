"""Ready-made objects in a frame that a file of extrinsics alone places on the robot."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.calls import call

CASES = ("objects_in_optical_frame",)


def test_results_are_of_the_file_that_placed_the_frame(
    case_input: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, database = case_input(CASES[0]) / f"{CASES[0]}.mcap", tmp_path / "a.db"
    words = ("map", log, "--map", database)
    assert call(*words) == 0
    place = tmp_path / "camera.toml"
    for x_m, state in ((0.076, "ran"), (0.076, "reused"), (0.5, "ran")):
        place.write_text(
            f"[[transforms]]\nparent = 'base_link'\nchild = 'camera_rgb_optical_frame'\nxyz = [{x_m}, 0.0, 0.1]\n"
            "quaternion = [-0.5, 0.5, -0.5, 0.5]\n"
        )
        capsys.readouterr()
        assert call(*words, "--extrinsics", place) == 0
        assert f"build_map {state}" in capsys.readouterr().err
