"""Folders elsewhere for what reads paths only: all files below a prefix."""

import hashlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PurePosixPath

from mcap_landmarks.errors import RemoteError
from mcap_landmarks.progress import Progress
from mcap_landmarks.remote.addresses import shown
from mcap_landmarks.remote.refusals import ChangedError, persistently
from mcap_landmarks.remote.store_listing import beside
from mcap_landmarks.remote.stored_file import size_in, version_in
from mcap_landmarks.remote.stores import Entry, store

_AT_ONCE = 8
_SMALL = 4 << 20
"""Files up to this size come in one request, as the images of a data set do."""


class StoredFolder:
    """The files below a prefix; `version` changes with any of them, `size` is of all."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._file_system, path = store(text)
        prefix = f"{path.rstrip('/')}/"
        found = persistently(text, lambda: self._file_system.find(prefix, detail=True))
        self._entries: Mapping[str, Entry] = {
            name: entry
            for name, entry in sorted(found.items())
            if entry.get("type") == "file" and name.startswith(prefix) and not name.endswith("/")
        }
        self._prefix = prefix
        self.size = sum(size_in(entry, name) for name, entry in self._entries.items())
        told = "\n".join(f"{name} {version_in(entry)}" for name, entry in self._entries.items())
        self.version = hashlib.sha256(told.encode()).hexdigest()

    def copy_to(self, folder: Path, copy_file: Callable[[str, Path, Progress], None], progress: Progress) -> None:
        """Copy every file, several at once; `copy_file` copies one that is large, of a URL.

        Raises:
            RemoteError: one cannot be copied, or has a name that leads out of the folder.
            OSError: it cannot be written.
        """

        def copy(name: str) -> None:
            target, url = self._target(folder, name), beside(self._text, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            size = size_in(self._entries[name], name)
            if size > _SMALL:
                copy_file(url, target, progress)
                return
            target.write_bytes(persistently(url, lambda: self._content(name, size)))
            progress(size)

        with ThreadPoolExecutor(_AT_ONCE) as pool:
            for _ in pool.map(copy, self._entries):
                pass

    def _content(self, name: str, size: int) -> bytes:
        content = self._file_system.cat_file(name)
        if len(content) != size:
            raise ChangedError
        return content

    def _target(self, folder: Path, name: str) -> Path:
        relative = PurePosixPath(name[len(self._prefix) :])
        if relative.is_absolute() or ".." in relative.parts:
            raise RemoteError(f"{shown(self._text)} holds {name!r}, which leads out of it; rename that")
        return folder / relative
