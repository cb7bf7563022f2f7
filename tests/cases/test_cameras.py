"""A camera that cannot be understood, before its images are looked at."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.calls import call

CASES = ("info_half_size",)


def test_a_camera_that_cannot_be_understood_is_refused_before_images_are_looked_at(
    case_input: Callable[[str], Path], site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = case_input("info_half_size") / "info_half_size.mcap"
    for words in (
        ("localize", log, "--map", site, "-o", tmp_path / "o.mcap"),
        ("map", log, "--map", tmp_path / "m.db"),
    ):
        capsys.readouterr()
        assert call(*words) == 1
        said = capsys.readouterr().err
        assert "/camera/camera_info: the CameraInfo is of 320 x 240 pixels, but the images are of 640 x 480; " in said
        assert "detect" not in said
    assert list(tmp_path.iterdir()) == []
    assert call("info", log, "--check") == 3
    assert "problem: /camera/camera_info: the CameraInfo is of 320 x 240 pixels" in capsys.readouterr().out
