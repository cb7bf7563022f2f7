"""Output files: whole or not at all, one writer at a time, nothing left behind."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from mcap_landmarks.atomic import atomic_file, check_target, held
from mcap_landmarks.errors import RecordingError, UsageError

WRITER = (
    "import sys; from pathlib import Path; from mcap_landmarks.atomic import atomic_file\n"
    "with atomic_file(Path(sys.argv[1])) as stream:\n    print('writing', flush=True)\n    sys.stdin.read()"
)


def write(path: Path, content: bytes = b"new") -> None:
    with atomic_file(path) as stream:
        stream.write(content)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_one_process_at_a_time_and_a_killed_one_leaves_nothing_that_lasts(tmp_path: Path) -> None:
    target = tmp_path / "out"
    command = [sys.executable, "-c", WRITER, str(target)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"writing\n"
        with pytest.raises(RecordingError, match=r"out: another run writes to it; wait until that ends, or"):
            write(target)
        write(tmp_path / "other")
        other.kill()
    assert not target.exists()
    assert len(names(tmp_path)) == 3  # what it wrote so far, and its lock, which nobody holds
    write(target)
    assert names(tmp_path) == ["other", "out"]


def test_what_others_write_is_not_left_over(tmp_path: Path) -> None:
    with atomic_file(tmp_path / "a.b") as stream:
        write(tmp_path / "a")
        stream.write(b"later")
    assert (tmp_path / "a.b").read_bytes() == b"later"
    with held(tmp_path / "a"):
        write(tmp_path / "a", b"by who holds it")
    assert names(tmp_path) == ["a", "a.b"]


def test_a_link_stays_one_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link, real = tmp_path / "link", tmp_path / "there" / "real"
    link.symlink_to(real)
    for content in (b"first", b"second"):  # dangling at first
        write(link, content)
        assert link.is_symlink()
        assert real.read_bytes() == content
    assert names(tmp_path / "there") == ["real"]
    (tmp_path / "far").symlink_to(tmp_path / "nowhere" / "file")
    (tmp_path / "round").symlink_to(tmp_path / "round")
    for name, reason in (("far", "nowhere does not exist; create it first"), ("round", "is not a regular file")):
        with pytest.raises(UsageError, match=reason):
            check_target(tmp_path / name)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", tmp_path, Path("/dev/full"), Path("/dev/null")):
        with pytest.raises(UsageError, match="is not a regular file; name a file that may be written"):
            write(place)
    with pytest.raises(RecordingError, match=r"/proc/out: cannot be written \(.*\); free space or"):
        write(Path("/proc/out"))


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    write(tmp_path / "out", b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RecordingError, match=r"out: cannot be written \(No space left on device\)"):
        write(tmp_path / "out")
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out").read_bytes() == b"old"


def test_where_files_cannot_be_locked_they_are_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", none)
    write(tmp_path / "out")
    assert names(tmp_path) == ["out"]
