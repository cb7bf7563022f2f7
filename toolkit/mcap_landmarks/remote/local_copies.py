"""Files elsewhere for what reads paths only: copied once, whole or not at all, and streams of URLs."""

import contextlib
import hashlib
import shutil
import threading
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast
from urllib.parse import urlsplit

from mcap_landmarks import memory
from mcap_landmarks.errors import RemoteError
from mcap_landmarks.remote.addresses import shown
from mcap_landmarks.remote.refusals import persistently
from mcap_landmarks.remote.remote_file import RemoteFile
from mcap_landmarks.remote.scratch_folder import scratch_folder
from mcap_landmarks.remote.shown_copies import NOTE, WATCH
from mcap_landmarks.remote.stored_file import WholeOnlyError, stored_file
from mcap_landmarks.remote.stores import store

_PIECE = 4 << 20
_copied: dict[str, tuple[str, Path]] = {}
"""Version and copy by URL."""


def open_url(text: str) -> BinaryIO:
    """A file elsewhere, for reading; of a web server that gives no parts of files a local copy of it.

    Raises:
        RemoteError: there is none, or it cannot be read.
        UsageError: the scheme is unknown, or the library for it not installed.
    """
    is_closed = threading.Event()
    try:
        return cast("BinaryIO", RemoteFile(text, stored_file(text, is_closed), is_closed))
    except WholeOnlyError as without_parts:
        return _copy_of_all(text, without_parts).open("rb")


def local_copy(text: str) -> Path:
    """A copy of a file elsewhere in the scratch folder: made when it is first asked for, and anew when it was changed.

    Raises:
        RemoteError, UsageError: see `open_url`; or there is no room for it.
    """
    is_closed = threading.Event()
    try:
        stored = stored_file(text, is_closed)
    except WholeOnlyError as without_parts:
        return _copy_of_all(text, without_parts)
    version, copy = _copied.get(text, (None, Path()))
    if version == stored.version and copy.is_file():
        return copy
    name = PurePosixPath(urlsplit(text).path).name
    with RemoteFile(text, stored, is_closed) as source, WATCH.get()(f"copy {name}", stored.size) as advance:
        _make_room(text, stored.size)

        def fill(partial: Path) -> None:
            with partial.open("wb") as target:
                while piece := source.read(_PIECE):
                    target.write(piece)
                    advance(len(piece))

        return _copied_by(fill, text, stored.version)


def size_of_url(text: str) -> int:
    """Bytes of a file elsewhere.

    Raises:
        RemoteError, UsageError: see `open_url`.
    """
    try:
        return stored_file(text, threading.Event()).size
    except WholeOnlyError as without_parts:
        return _copy_of_all(text, without_parts).stat().st_size


def _copy_of_all(text: str, without_parts: WholeOnlyError) -> Path:
    """A copy of a file of which parts cannot be read; made once, where the server does not tell that it was changed."""
    version, copy = _copied.get(text, (None, Path()))
    if version == without_parts.version and copy.is_file():
        return copy
    NOTE.get()(f"{shown(text)}: its server gives no parts of files, so that all of it is copied first")
    file_system, path = store(text)
    with WATCH.get()(f"copy {PurePosixPath(urlsplit(text).path).name}", None):
        _make_room(text, without_parts.size or 0)
        return _copied_by(
            lambda partial: persistently(text, lambda: file_system.get_file(path, str(partial))),
            text,
            without_parts.version,
        )


def _copied_by(fill: Callable[[Path], None], text: str, version: str) -> Path:
    """The copy of a URL that `fill` makes in the file it is given; it takes its name when it is whole."""
    name = PurePosixPath(urlsplit(text).path).name
    folder = scratch_folder() / hashlib.sha256(text.encode()).hexdigest()[:16]
    copy = folder / (name if name.strip(".") else "file")
    partial = folder / f"{copy.name}.partial"
    try:
        folder.mkdir(exist_ok=True)
        fill(partial)
        partial.replace(copy)
    except OSError as error:
        remedy = "free space there, or set TMPDIR to another folder"
        raise RemoteError(f"{shown(text)} cannot be copied to {folder} ({error.strerror}); {remedy}") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
    _copied[text] = version, copy
    return copy


def _make_room(text: str, size: int) -> None:
    """Refuse a copy for which there is no room, before anything is read.

    Raises:
        RemoteError: there is none.
    """
    folder = scratch_folder()
    if size > (free := shutil.disk_usage(folder).free):
        sizes = f"{memory.shown(size)}, {memory.shown(free)} are free"
        raise RemoteError(
            f"{shown(text)} is copied to {folder} to be read, where it does not fit ({sizes}); set TMPDIR"
        )
