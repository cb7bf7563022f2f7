"""Cameras and scans that say something else than the standard: read as what they are, or refused by name."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cases.steps import check_case
from tests.cli.calls import call

CASES = (
    "info_binning",
    "info_half_size",
    "no_odometry",
    "scan_in_degrees",
    "scan_in_mm",
    "scan_range_max_zero",
    "scan_time_increment_us",
)


@pytest.mark.parametrize("name", CASES)
def test_what_is_expected_of_a_case_holds(
    name: str,
    case_input: Callable[[str], Path],
    site: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    check_case(name, case_input(name), site, monkeypatch, capsys)


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
