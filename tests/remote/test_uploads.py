"""Outputs at URLs appear whole or not at all, and what could not be sent is kept where the error says."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap_landmarks.atomic import atomic_file, atomic_folder, held
from mcap_landmarks.errors import RecordingError, RemoteError, UsageError
from mcap_landmarks.locations import files_in, is_there, location
from mcap_landmarks.remote import refusals, stores, uploads
from mcap_landmarks.remote.staged_outputs import staged_output
from s3fs.core import S3File

from tests.remote.object_store import Bucket

MIB = 1 << 20
Put = Callable[[str, bytes], object]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of the test's own, and no pauses between tries."""
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(refusals, "PAUSES_S", (0.0, 0.0, 0.0))
    return tmp_path / "cache"


def left_in(cache: Path) -> list[str]:
    return sorted(path.name for path in cache.rglob("*") if path.is_file())


def write(url: str, content: bytes) -> None:
    with atomic_file(location(url)) as stream:
        stream.write(content)


@pytest.mark.parametrize("size", [0, 5, 5 * MIB, 5 * MIB + 1, 11 * MIB])
def test_a_file_is_the_same_there_and_leaves_nothing_here(
    size: int, bucket: Bucket, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "PART", 5 * MIB)
    content = (bytes(range(251)) * (size // 251 + 1))[:size]
    bucket.write("out/a.bin", b"earlier")
    write(bucket.url("out/a.bin"), content)
    assert bucket.read("out/a.bin") == content
    assert bucket.names() == ["out/a.bin"]  # and no folder as a file of its own
    assert left_in(cache) == bucket.unfinished() == []


def put_by(bucket: Bucket, monkeypatch: pytest.MonkeyPatch, put: Callable[[Put, str, bytes], object]) -> None:
    """Let `put` send files in one request; it gets what does that as its first argument."""
    files: Any = stores.store(bucket.url("any"))[0]
    sent: Put = files.pipe_file
    monkeypatch.setattr(files, "pipe_file", lambda path, content: put(sent, path, content))


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), ConnectionResetError(), PermissionError()])
def test_an_upload_in_parts_that_stops_leaves_the_old_file_and_no_parts(
    stop: BaseException, bucket: Bucket, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "PART", 5 * MIB)
    bucket.write("a.bin", b"earlier")
    sent = S3File._call_s3

    def fail_late(self: S3File, method: str, *given: object, **named: object) -> object:
        if named.get("PartNumber") == 2:
            raise stop
        return sent(self, method, *given, **named)

    monkeypatch.setattr(S3File, "_call_s3", fail_late)
    expected = RemoteError if isinstance(stop, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as error:
        write(bucket.url("a.bin"), bytes(11 * MIB))
    assert bucket.read("a.bin") == b"earlier"
    assert bucket.unfinished() == []
    if expected is KeyboardInterrupt:
        assert left_in(cache) == []
        return
    kept = staged_output(bucket.url("a.bin"))
    assert str(error.value).startswith(bucket.url("a.bin"))
    assert str(error.value).endswith(f"or take what was made from {kept}, where it is kept")
    assert kept.stat().st_size == 11 * MIB
    monkeypatch.setattr(S3File, "_call_s3", sent)
    write(bucket.url("a.bin"), b"again")
    assert bucket.read("a.bin") == b"again"
    assert left_in(cache) == []


def test_a_dropped_connection_is_tried_again_then_named(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    tries = []

    def drop(sent: Put, path: str, content: bytes) -> object:
        tries.append(path)
        if len(tries) % 5:
            raise ConnectionResetError
        return sent(path, content)

    put_by(bucket, monkeypatch, drop)
    with pytest.raises(RemoteError, match=r"the connection was dropped \(4 tries\)"):
        write(bucket.url("a"), b"x")
    write(bucket.url("a"), b"x")  # at once, as the fifth try goes through
    assert bucket.read("a") == b"x"
    assert len(tries) == 5


def test_what_arrives_of_another_size_is_told(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    put_by(bucket, monkeypatch, lambda sent, path, content: sent(path, content[:-1]))
    with pytest.raises(RemoteError, match=r"has 3 bytes instead of the 4 that were sent"):
        write(bucket.url("a"), b"four")


def test_a_block_that_fails_sends_nothing(bucket: Bucket, cache: Path) -> None:
    def fail_half_way() -> None:
        with atomic_file(location(bucket.url("a"))) as stream:
            stream.write(b"half")
            raise RecordingError("no")

    with pytest.raises(RecordingError):
        fail_half_way()
    assert bucket.names() == left_in(cache) == []


def test_a_full_disk_names_the_url_and_where_there_is_no_room(
    bucket: Bucket, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("mcap_landmarks.atomic.os.fsync", full)
    with pytest.raises(RecordingError) as error:
        write(bucket.url("a"), b"x")
    assert str(error.value) == (
        f"{bucket.url('a')}: cannot be made in {staged_output(bucket.url('a')).parent} (No space left on device); free "
        "space there, or let MCAP_LANDMARKS_CACHE name another folder"
    )
    assert bucket.names() == left_in(cache) == []


def test_a_folder_is_replaced_file_by_file_the_last_written_last(bucket: Bucket, cache: Path) -> None:
    bucket.write("bag/old.bin", b"old")
    bucket.write("bagpipe.bin", b"other")
    target = location(bucket.url("bag/"))
    with atomic_folder(target) as folder:
        (folder / "deep").mkdir()
        (folder / "deep" / "b.bin").write_bytes(b"b")
        (folder / "a.bin").write_bytes(b"a")
    assert bucket.names() == ["bag/a.bin", "bag/deep/b.bin", "bagpipe.bin"]
    assert [str(file) for file in files_in(target)] == [bucket.url("bag/a.bin"), bucket.url("bag/deep/b.bin")]
    assert left_in(cache) == []


def test_a_folder_that_cannot_be_sent_whole_is_not_there_in_part(
    bucket: Bucket, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(sent: Put, path: str, content: bytes) -> object:
        if path.endswith("b.bin"):
            raise PermissionError
        return sent(path, content)

    def make() -> None:
        with atomic_folder(location(bucket.url("bag"))) as folder:
            (folder / "a.bin").write_bytes(b"a")
            (folder / "b.bin").write_bytes(b"b")

    put_by(bucket, monkeypatch, refuse)
    with pytest.raises(RemoteError) as error:
        make()
    assert bucket.names() == []
    assert left_in(cache) == ["a.bin", "b.bin"]
    assert f"{staged_output(bucket.url('bag'))}, where it is kept" in str(error.value)


def test_another_run_on_this_machine_is_kept_off(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    place = location(bucket.url("a"))
    with held(place):
        monkeypatch.setattr("mcap_landmarks.atomic._held", set())  # as another process has it
        with pytest.raises(RecordingError, match=r"another run writes to it"), held(place):
            pass


def test_what_cannot_be_written_is_refused_before_anything_runs(bucket: Bucket) -> None:
    for url, reason in (
        (f"s3://{bucket.name}", "names no file"),
        (bucket.url("folder/"), "names no file"),
        ("https://host.example/a.mcap", "nothing can be written to a web server"),
        (bucket.url("a?versionId=secret"), "an output has no query"),
        ("ftp://host.example/a", "URLs of this scheme cannot be"),
    ):
        with pytest.raises(UsageError, match=reason) as error:
            write(url, b"")
        assert "secret" not in str(error.value)
    assert not is_there(location(bucket.url("nothing")))
    with pytest.raises(RemoteError, match="there is no such bucket"):
        is_there(location("s3://no-such-bucket-here/a"))


def test_memory_is_a_store_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "PART", 4)
    write("memory://uploads/a.bin", b"not in parts")
    file_system, path = stores.store("memory://uploads/a.bin")
    assert file_system.cat_file(path) == b"not in parts"
    file_system.rm_file(path)
