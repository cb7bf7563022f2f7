"""The command line as tests call it, and what they look at afterwards."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap_landmarks.cli.main import run
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource


def call(*words: object) -> int:
    """Exit code of the command line."""
    with pytest.raises(SystemExit) as stop:
        run([str(word) for word in words])
    return int(stop.value.code or 0)


def refused(capsys: pytest.CaptureFixture[str], code: int, *words: object) -> str:
    """The one line on stderr of a refusal."""
    capsys.readouterr()
    assert call(*words) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def schema_of(verb: str) -> dict[str, Any]:
    """The JSON schema of what a verb prints."""
    found: dict[str, Any] = json.loads(resource("schemas", f"json/{verb}.schema.json").read_text())
    return found


def topics(path: Path) -> dict[str, int]:
    """The number of messages of each topic of a recording."""
    with open_recording(path) as recording:
        return {entry.connection.topic: entry.count for entry in recording.channels}
