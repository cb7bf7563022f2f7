"""A file in a store: its size, and its bytes from one place to another, always of the one that was opened."""

import threading
from collections.abc import Callable
from typing import Protocol, cast

from mcap_landmarks.errors import RemoteError
from mcap_landmarks.remote.addresses import scheme_of, shown
from mcap_landmarks.remote.refusals import ChangedError, DroppedError, persistently
from mcap_landmarks.remote.stores import Entry, FileSystem, is_web, store


class StoredFile(Protocol):
    """What a `RemoteFile` reads. `version` tells contents apart; empty where the store says nothing of it.

    `begin` is what the opening already brought, from the first byte on.
    """

    size: int
    version: str
    begin: bytes

    def bytes_of(self, start: int, end: int) -> bytes:
        """The bytes from one place to another, in one request; may be called from several threads at once.

        Raises:
            Exception: what the libraries raise; see `refusals`.
        """


class FolderError(RemoteError):
    """A prefix of files, where a file is meant."""


_BUCKETS = {**dict.fromkeys(("s3", "gs"), "bucket"), **dict.fromkeys(("az", "abfs", "abfss"), "container")}
"""What the stores call the first part of a path, which names no file yet."""


def stored_file(text: str, is_closed: threading.Event) -> StoredFile:
    """The file of a URL.

    Raises:
        RemoteError: there is none, or it cannot be read.
        FolderError: as the class says.
        UsageError: as `store` says.
        WholeOnlyError: as the class says.
    """
    file_system, path = store(text)
    if is_web(text):
        from mcap_landmarks.remote.web_file import WebFile  # noqa: PLC0415 # a library that other stores do without

        return persistently(text, lambda: WebFile(file_system, text), is_closed)
    scheme = scheme_of(text)
    if scheme in _BUCKETS and "/" not in path.strip("/"):
        bucket = _BUCKETS[scheme]
        what = f"names a {bucket}, not a file" if path.strip("/") else f"names neither a {bucket} nor a file"
        raise RemoteError(f"{shown(text)}: {what}; name a file, as {scheme}://{bucket.upper()}/NAME")
    kind = _PinnedFile if scheme == "s3" else _CheckedFile

    def open_it() -> StoredFile:
        try:
            return kind(file_system, path)
        except IsADirectoryError as error:
            raise FolderError(f"{shown(text)}: it is a folder; name a file in it") from error

    return persistently(text, open_it, is_closed)


def version_in(entry: Entry) -> str:
    """What a store says that changes with a content: by s3fs, gcsfs, adlfs and fsspec's own memory."""
    names = ("ETag", "etag", "generation", "VersionId", "LastModified", "last_modified", "mtime", "created", "size")
    return " ".join(str(value) for name in names if (value := entry.get(name)) is not None)


def size_in(entry: Entry, path: str) -> int:
    """The bytes of a file.

    Raises:
        IsADirectoryError: it is a folder.
    """
    if entry.get("type") == "directory":
        raise IsADirectoryError(path)
    return int(cast("int", entry.get("size")))


class _Fetching(Protocol):
    fetcher: Callable[[int, int], bytes]


class _OpenedFile(Protocol):
    """A file of s3fs: what its store says of it, and what gets parts of that version."""

    details: Entry
    cache: _Fetching


class _PinnedFile:
    """A file of S3, which is asked for parts of that ETag only."""

    begin = b""

    def __init__(self, file_system: FileSystem, path: str) -> None:
        opened = cast("_OpenedFile", file_system.open(path, "rb", cache_type="none"))
        self.size, self.version = size_in(opened.details, path), version_in(opened.details)
        self._get = opened.cache.fetcher

    def bytes_of(self, start: int, end: int) -> bytes:
        """See `StoredFile`."""
        return _whole(self._get(start, end), start, end)


class _CheckedFile:
    """A file of any other store: after each part it is asked whether the file is still the same."""

    begin = b""

    def __init__(self, file_system: FileSystem, path: str) -> None:
        self._file_system, self._path = file_system, path
        entry = file_system.info(path)
        self.size, self.version = size_in(entry, path), version_in(entry)

    def bytes_of(self, start: int, end: int) -> bytes:
        """See `StoredFile`."""
        found = self._file_system.cat_file(self._path, start, end)
        if version_in(self._file_system.info(self._path)) != self.version:
            raise ChangedError
        return _whole(found, start, end)


def _whole(found: bytes, start: int, end: int) -> bytes:
    if len(found) != end - start:
        raise DroppedError
    return found
