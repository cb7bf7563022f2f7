"""The verb plot."""

from pathlib import Path

import pytest
from mcap_landmarks.channels import TRUTH_POSE
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, USAGE, run_command
from mcap_landmarks.cli.main import build

from tests.diff.recordings import localized_log, localized_messages, write

APPENDIX_D = Path(__file__).parents[1] / "data" / "thesis_appendix_d.txt"


def run(*arguments: str | Path) -> int:
    return run_command(build("plot"), ["plot", *map(str, arguments)])


def test_a_picture_appears(tmp_path: Path) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert run(log, "-o", tmp_path / "r.PNG", "--align", "--title", "Run") == DONE
    assert (tmp_path / "r.PNG").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("show", ["map", "positions", "errors"])
def test_every_kind_of_plot(show: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(APPENDIX_D, "--show", show, "-o", tmp_path / "d.svg") == DONE
    assert b"<svg" in (tmp_path / "d.svg").read_bytes()[:500]
    log = write(tmp_path / "r.mcap", [entry for entry in localized_messages() if entry[0] != TRUTH_POSE])
    if show != "map":
        assert run(log, "--show", show, "-o", tmp_path / "r.svg") == UNUSABLE
        assert "no position has a truth" in capsys.readouterr().err


def test_trouble_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert run(log, "-o", tmp_path / "r.gif") == USAGE
    assert "use .png, .svg, .pdf" in capsys.readouterr().err
    assert run(tmp_path / "none.mcap", "-o", tmp_path / "r.png") == UNUSABLE
    assert not (tmp_path / "r.png").exists()
    log.write_bytes(log.read_bytes()[:-200])
    assert run(log, "-o", tmp_path / "r.png") == PARTIAL
    assert "warning: " in capsys.readouterr().err
