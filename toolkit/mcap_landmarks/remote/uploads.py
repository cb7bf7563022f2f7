"""Files to a store: each appears there whole or not at all, as a put or the end of an upload in parts replaces it."""

import contextlib
from pathlib import Path
from typing import Protocol, cast

from mcap_landmarks.errors import RemoteError, UsageError
from mcap_landmarks.progress import Progress
from mcap_landmarks.remote.addresses import scheme_of, shown
from mcap_landmarks.remote.refusals import persistently
from mcap_landmarks.remote.stores import Entry, FileSystem, is_web, store

PART = 16 << 20
"""What is not larger goes in one request, the rest in parts of this size: a dropped connection costs no more than one.
S3 takes parts from 5 MiB on."""
_MOST_PARTS = 9_000
"""S3 takes 10,000 of an upload."""
_NO_STORE = ("bucket does not exist", "ContainerNotFound", "container does not exist", "NoSuchBucket")


class _Upload(Protocol):
    """A file of fsspec that is being written, see its `AbstractBufferedFile`."""

    closed: bool

    def write(self, piece: bytes) -> int: ...

    def close(self) -> None: ...

    def commit(self) -> None: ...

    def discard(self) -> None: ...


def check_uploadable(text: str, *, is_folder: bool = False) -> None:
    """Refuse a URL that nothing can be written to, before anything runs.

    Raises:
        UsageError: it is of a web server, has a query, names no file, or see `store`.
    """
    if is_web(text):
        raise UsageError(
            f"{shown(text)}: nothing can be written to a web server; write to s3://, gs:// or az://, or to a file"
        )
    if "?" in text:
        raise UsageError(f"{shown(text)}: an output has no query; credentials come from the environment")
    _, path = store(text)
    if not is_folder and (text.endswith("/") or ("/" not in path.strip("/") and scheme_of(text) != "memory")):
        raise UsageError(f"{shown(text)}: names no file; add the name of one")


def is_stored(text: str) -> bool:
    """Whether there is a file of this URL.

    Raises:
        UsageError, RemoteError: see `store`; it cannot be asked for, or there is no such bucket.
    """
    file_system, path = store(text)

    def ask() -> bool:
        try:
            return file_system.info(path).get("type") != "directory"
        except FileNotFoundError as error:
            if any(words in str(error) for words in _NO_STORE):
                raise
            return False

    return persistently(text, ask)


def upload(source: Path, text: str, progress: Progress = lambda _advance: None) -> None:
    """Put a file where a URL says, in place of what is there; tried again when the connection is dropped.

    Raises:
        RemoteError: it cannot be written there; what was there is there still.
    """
    file_system, path = store(text)
    size = source.stat().st_size
    if size <= PART or scheme_of(text) == "memory":  # which shows what was not ended, too
        content = source.read_bytes()
        persistently(text, lambda: file_system.pipe_file(path, content))
        progress(size)
    else:
        persistently(text, lambda: _in_parts(file_system, path, source, max(PART, size // _MOST_PARTS), progress))
    found = persistently(text, lambda: _size(file_system.info(path)))
    if found != size:
        raise RemoteError(f"{shown(text)}: has {found} bytes instead of the {size} that were sent; write it again")


def remove_stored(text: str) -> None:
    """Remove a file from a store.

    Raises:
        RemoteError: it cannot be removed.
    """
    file_system, path = store(text)
    persistently(text, lambda: file_system.rm_file(path))


def _size(entry: Entry) -> int:
    return int(cast("int", entry.get("size")))


def _in_parts(file_system: FileSystem, path: str, source: Path, part: int, progress: Progress) -> None:
    """Upload in parts, which the store joins when the last one is there; else it forgets them."""
    target = cast("_Upload", file_system.open(path, "wb", block_size=part, autocommit=False))
    try:
        with source.open("rb") as stream:
            while piece := stream.read(part):
                target.write(piece)
                progress(len(piece))
        target.close()
        target.commit()
    except BaseException:
        with contextlib.suppress(Exception):
            target.discard()
        target.closed = True  # else it would send what it has when it is collected
        raise
