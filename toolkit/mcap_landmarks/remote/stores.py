"""From a URL to the fsspec file system that reads and writes there, with credentials of the environment only."""

import importlib
import os
from collections.abc import Iterable, Mapping
from typing import IO, NamedTuple, Protocol

from mcap_landmarks.errors import UsageError
from mcap_landmarks.remote.addresses import scheme_of, shown
from mcap_landmarks.remote.refusals import refusal


class Entry(Protocol):
    """What a store says of a file: `name`, `size`, `type` and, by names of its own, its version."""

    def get(self, key: str, /) -> object:
        """A value, None if there is none."""


class FileSystem(Protocol):
    """What is used of fsspec's `AbstractFileSystem`, whose documentation says how; paths are those of `store`."""

    def info(self, path: str) -> Entry:
        """What is said of a file or folder; FileNotFoundError if there is none."""

    def exists(self, path: str) -> bool:
        """Whether there is a file or folder."""

    def find(self, path: str, *, detail: bool) -> Mapping[str, Entry]:
        """All files below a path, by their paths; the one that it names."""

    def glob(self, path: str, *, detail: bool) -> Mapping[str, Entry]:
        """All files and folders that fit a pattern, by their paths."""

    def open(self, path: str, mode: str = ..., **settings: object) -> IO[bytes]:
        """A stream."""

    def cat_file(self, path: str, start: int | None = ..., end: int | None = ..., **settings: object) -> bytes:
        """The bytes from one place to another."""

    def get_file(self, path: str, local: str, **settings: object) -> None:
        """Copy one file to a path."""

    def put_file(self, local: str, path: str, **settings: object) -> None:
        """Copy the file at a path to the store."""

    def pipe_file(self, path: str, value: bytes, **settings: object) -> None:
        """Write a file."""

    def rm_file(self, path: str) -> None:
        """Remove a file."""


class _Library(NamedTuple):
    module: str
    extra: str | None = None
    settings: Mapping[str, object] = {}


_S3 = _Library("s3fs", "s3")
_AZURE = _Library("adlfs", "azure")
_WEB = _Library("aiohttp", None, {"client_kwargs": {"trust_env": True}})  # proxies and .netrc
_LIBRARIES = {
    "s3": _S3,
    "gs": _Library("gcsfs", "gcs"),
    "az": _AZURE,
    "abfs": _AZURE,
    "abfss": _AZURE,
    "http": _WEB,
    "https": _WEB,
    "memory": _Library("fsspec"),
}
"""What reads each scheme. `memory://` is fsspec's own, within the process: for tests, and the Python API."""


def store(text: str) -> tuple[FileSystem, str]:
    """The file system of a URL, and the path in it.

    It lists nothing from memory: what a store held a while ago is not what it holds.

    Raises:
        UsageError: the scheme is unknown, or the library for it not installed.
        RemoteError: there are no credentials, where they are looked for at once.
    """
    library = _library(text)
    try:
        importlib.import_module(library.module)
    except ImportError as error:
        remedy = f"pip install 'mcap-landmarks[{library.extra}]'" if library.extra else f"pip install {library.module}"
        raise UsageError(
            f"{shown(text)}: {library.module}, which reads such URLs, is not installed; {remedy}"
        ) from error
    fsspec = importlib.import_module("fsspec.core")
    found: tuple[FileSystem, str]
    try:
        found = fsspec.url_to_fs(text, use_listings_cache=False, **library.settings, **_once(library))
    except Exception as error:
        raise refusal(text, error) from error
    return found


def is_web(text: str) -> bool:
    """Whether a web server has it, which lists nothing and may not know parts of files."""
    return _library(text) is _WEB


def schemes() -> Iterable[str]:
    """The schemes that can be read."""
    return _LIBRARIES.keys()


def _once(library: _Library) -> Mapping[str, object]:
    """Settings by which botocore leaves it to `refusals` to try again, unless the environment says how often."""
    if library is not _S3:
        return {}
    once = {} if "AWS_MAX_ATTEMPTS" in os.environ else {"retries": {"total_max_attempts": 1}}
    return {"config_kwargs": {"max_pool_connections": 64, **once}}


def _library(text: str) -> _Library:
    library = _LIBRARIES.get(scheme_of(text))
    if library is None:
        known = ", ".join(f"{scheme}://" for scheme in _LIBRARIES)
        raise UsageError(f"{shown(text)}: URLs of this scheme cannot be read or written; known are {known} and file://")
    return library
