"""What the terminal shows while work goes on."""

import io
import re
import sys

import pytest
from mcap_landmarks.cli.console import progress


class Terminal(io.StringIO):
    """What takes itself for a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("unit", "shown"), [("bundles", "3/4 bundles"), ("bytes", "3/4 bytes")])
def test_a_terminal_shows_what_is_done_and_what_is_left(monkeypatch: pytest.MonkeyPatch, unit: str, shown: str) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    with progress("detect small.mcap", 4, unit) as advance:
        advance(1)
        advance(2)
    said = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.getvalue())
    assert "detect small.mcap" in said
    assert shown in said
    assert "/s " in said
    assert re.search(r"\d:\d\d:\d\d", said)


def test_what_is_no_terminal_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("detect small.mcap", 4, "bundles") as advance:
        advance(1)
    assert capsys.readouterr().err == ""
