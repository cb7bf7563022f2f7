"""What the terminal shows while work goes on."""

import io
import json
import re
import sys
from pathlib import Path

import pytest
from mcap.writer import Writer
from mcap_landmarks.cli.console import progress, say, say_json, table, warn

from tests.cli.calls import call

EVIL = "/a\x1b[31mb\n/c\r\x07\x9b2J\u202ed\ud800\u2028e\x7f"
HARM = re.compile(r"[\0-\x1f\x7f-\x9f\u202e\u2028\ud800]")


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


def test_names_are_printed_without_their_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    """What a log calls its topics neither acts on the terminal nor forges a line."""
    say(f"topic {EVIL}")
    warn(f"note: {EVIL}")
    table(["topic", EVIL], [[EVIL, "1"], ["/caf\u00e9", "22"]])
    told = capsys.readouterr()
    lines = [*told.out.splitlines(), *told.err.splitlines()]
    assert lines[0] == "topic /a[31mb /c 2Jd e"
    assert len(lines) == 5
    assert not [line for line in lines if HARM.search(line)]
    assert lines[3].startswith("/caf\u00e9 "), "letters of other languages stay"
    ends = {line.rindex(word) + len(word) for line, word in zip(lines[2:4], ("1", "22"), strict=True)}
    assert len(ends) == 1, "what is left out takes no room"


def test_json_escapes_them(capsys: pytest.CaptureFixture[str]) -> None:
    say_json("info", {"topic": EVIL, EVIL: ["\u00e9"]})
    text = capsys.readouterr().out
    assert not HARM.search(text.replace("\n", ""))
    assert "\u00e9" in text
    assert json.loads(text) == {"schema": "mcap-landmarks/info/1", "topic": EVIL, EVIL: ["\u00e9"]}


@pytest.mark.parametrize("options", [[], ["--check"], ["--json"]], ids=["plain", "check", "json"])
def test_no_verb_prints_what_a_log_names(tmp_path: Path, capfd: pytest.CaptureFixture[str], options: list[str]) -> None:
    path = tmp_path / "log.mcap"
    evil = EVIL.replace("\ud800", "")
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", evil)
        schema = writer.register_schema(evil, evil, evil.encode())
        writer.add_message(writer.register_channel(evil, evil, schema, {evil: evil}), 1, b"1", 1)
        writer.add_metadata(evil, {evil: evil})
        writer.add_attachment(1, 1, f"../{evil}", evil, b"1")
        writer.finish()
    call("info", path, *options)
    call("convert", path, "-o", tmp_path / "out.mcap", *([] if "--check" in options else options))
    told = capfd.readouterr()
    assert "31mb" in told.out
    assert not HARM.search((told.out + told.err).replace("\n", ""))
    assert sorted(tmp_path.iterdir()) in ([path], [path, tmp_path / "out.mcap"]), "no name makes a file"
