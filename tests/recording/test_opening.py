"""What is told of a recording that cannot be opened, and of that alone."""

from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError, ToolkitError
from mcap_landmarks.manifest import file_hash
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording


@pytest.mark.parametrize(
    ("name", "complaint"), [("none.mcap", "there is no such file"), (".", "is a folder; convert it first")]
)
def test_what_cannot_be_opened_is_named(tmp_path: Path, name: str, complaint: str) -> None:
    with pytest.raises(RecordingError, match=complaint), open_recording(tmp_path / name):
        pass


def test_errors_of_other_files_are_not_taken_for_the_recordings(tmp_path: Path) -> None:
    with create_recording(tmp_path / "a.mcap"):
        pass
    with pytest.raises(FileNotFoundError), open_recording(tmp_path / "a.mcap"):
        (tmp_path / "other").open()
    with pytest.raises(ToolkitError, match="other: cannot be read"), open_recording(tmp_path / "a.mcap"):
        file_hash(tmp_path / "other")
