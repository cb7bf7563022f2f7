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
from mcap_landmarks.progress import Progress
from mcap_landmarks.remote.addresses import shown
from mcap_landmarks.remote.folder_copies import StoredFolder
from mcap_landmarks.remote.refusals import WholeOnlyError, persistently
from mcap_landmarks.remote.remote_file import RemoteFile
from mcap_landmarks.remote.scratch_folder import scratch_folder
from mcap_landmarks.remote.shown_copies import NOTE, WATCH, name_copy
from mcap_landmarks.remote.stored_file import FolderError, stored_file
from mcap_landmarks.remote.stores import store

_PIECE = 4 << 20
_WITH_METADATA, _METADATA = (".db3", ".db3.zstd"), "metadata.yaml"
"""Storage files of ROS 2 bags, and what lies beside them and tells the types of their messages."""
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
    """A copy of a file or folder elsewhere in the scratch folder: made when it is first asked for, and when it changed.

    Raises:
        RemoteError, UsageError: see `open_url`; or there is no room for it.
    """
    is_closed = threading.Event()
    try:
        stored = stored_file(text, is_closed)
    except WholeOnlyError as without_parts:
        return _copy_of_all(text, without_parts)
    except FolderError:
        return _copy_of_folder(text)

    def fill(target: Path, advance: Progress) -> None:
        with RemoteFile(text, stored, is_closed) as source:
            _write(source, target, advance)
        if text.endswith(_WITH_METADATA):
            _copy_metadata(text, target.parent)

    return _copied_by(fill, text, stored.version, stored.size)


def size_of_url(text: str) -> int:
    """Bytes of a file elsewhere; 0 of a folder, as on this machine.

    Raises:
        RemoteError, UsageError: see `open_url`.
    """
    try:
        return stored_file(text, threading.Event()).size
    except FolderError:
        return 0
    except WholeOnlyError as without_parts:
        return _copy_of_all(text, without_parts).stat().st_size


def _copy_of_all(text: str, without_parts: WholeOnlyError) -> Path:
    """A copy of a file of which parts cannot be read; made once, where the server does not tell that it was changed."""

    def fill(target: Path, _advance: Progress) -> None:
        NOTE.get()(f"note: {shown(text)}: its server gives no parts of files, so that all of it is copied first")
        file_system, path = store(text)
        persistently(text, lambda: file_system.get_file(path, str(target)))

    return _copied_by(fill, text, without_parts.version, without_parts.size)


def _copy_of_folder(text: str) -> Path:
    folder = StoredFolder(text)

    def copy_file(url: str, target: Path, advance: Progress) -> None:
        with open_url(url) as source:
            _write(source, target, advance)

    def fill(target: Path, advance: Progress) -> None:
        target.mkdir()
        folder.copy_to(target, copy_file, advance)

    return _copied_by(fill, text, folder.version, folder.size)


def _copy_metadata(text: str, folder: Path) -> None:
    """What lies beside a storage file of a bag, if it does."""
    with contextlib.suppress(RemoteError), open_url(f"{text.rpartition('/')[0]}/{_METADATA}") as source:
        _write(source, folder / _METADATA, lambda _advance: None)


def _write(source: RemoteFile | BinaryIO, target: Path, advance: Progress) -> None:
    with target.open("wb") as stream:
        while piece := source.read(_PIECE):
            stream.write(piece)
            advance(len(piece))


def _copied_by(fill: Callable[[Path, Progress], None], text: str, version: str, size: int | None) -> Path:
    """The copy of a URL that `fill` makes at the path it is given; it gets its place when it is whole."""
    if text in _copied and _copied[text][0] == version:
        return _copied[text][1]
    given = PurePosixPath(urlsplit(text).path).name
    name = given if given.strip(".") else "file"
    partial = scratch_folder() / f"{len(_copied)}-{threading.get_ident()}.partial"
    folder = scratch_folder() / hashlib.sha256(f"{text} {version}".encode()).hexdigest()[:16]
    try:
        with WATCH.get()(f"copy {name}", size) as advance:
            _make_room(text, size or 0)
            partial.mkdir()
            fill(partial / name, advance)
            shutil.rmtree(folder, ignore_errors=True)
            partial.replace(folder)
    except OSError as error:
        remedy = "free space there, or set TMPDIR to another folder"
        where = scratch_folder().parent
        raise RemoteError(f"{shown(text)} cannot be copied to {where} ({error.strerror}); {remedy}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    _copied[text] = version, folder / name
    name_copy(folder / name, shown(text))
    return folder / name


def _make_room(text: str, size: int) -> None:
    """Refuse a copy for which there is no room, before anything is read.

    Raises:
        RemoteError: there is none.
    """
    where = scratch_folder().parent
    if size > (free := shutil.disk_usage(where).free):
        sizes = f"{memory.shown(size)}, {memory.shown(free)} are free"
        raise RemoteError(f"{shown(text)} is copied to {where} to be read, where it does not fit ({sizes}); set TMPDIR")
