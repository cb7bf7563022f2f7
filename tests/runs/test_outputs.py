"""Folders for results: made where they may be, refused in one line where not."""

from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.runs.outputs import make_folder, output_files


def test_a_folder_is_made_once_and_used_again(tmp_path: Path) -> None:
    make_folder(tmp_path / "new")
    make_folder(tmp_path / "new")
    assert (tmp_path / "new").is_dir()
    with pytest.raises(UsageError, match="does not exist; create it first"):
        make_folder(tmp_path / "a" / "b")


def test_where_nothing_may_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", forbidden)
    with pytest.raises(
        RecordingError, match=r"demo: cannot be made \(Permission denied\); choose another place with -o"
    ):
        make_folder(tmp_path / "demo")


def test_two_inputs_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="another input also writes"):
        output_files([Path("a/log.mcap"), Path("b/log.mcap")], tmp_path)
    assert output_files([Path("a/log.mcap")], tmp_path) == {Path("a/log.mcap"): tmp_path / "log.mcap"}


@pytest.mark.parametrize("name", ["a.bag", "a.DB3"])
def test_a_recording_is_not_called_a_bag(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=r"is an MCAP file; name it a\.mcap"):
        output_files([Path("log.mcap")], tmp_path / name)
