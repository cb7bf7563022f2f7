"""What lies in a store below a prefix or fits a pattern, as URLs; and whether a URL names a folder."""

import contextlib
import threading
from collections.abc import Mapping

from mcap_landmarks.errors import UsageError
from mcap_landmarks.remote.addresses import scheme_of, shown
from mcap_landmarks.remote.refusals import WholeOnlyError, persistently
from mcap_landmarks.remote.stored_file import stored_file
from mcap_landmarks.remote.stores import Entry, is_web, store


def urls_matching(text: str) -> list[str]:
    """The files that a URL with `*`, `?`, `[...]` or `**` (any depth) fits, those below a prefix, or the one file.

    Sorted by name. A web server lists nothing: there only the file itself can be meant.

    Raises:
        UsageError: there is nothing of that name, or a pattern for a web server; or see `store`.
        RemoteError: it cannot be listed.
    """
    if is_web(text):
        if "*" in text.partition("?")[0]:
            raise UsageError(f"{shown(text)}: a web server does not list its files; name each of them")
        with contextlib.suppress(WholeOnlyError):
            stored_file(text, threading.Event())
        return [text]
    file_system, path = store(text)
    is_pattern = any(mark in path for mark in "*?[")

    def list_it() -> Mapping[str, Entry]:
        return file_system.glob(path, detail=True) if is_pattern else file_system.find(path, detail=True)

    found = persistently(text, list_it)
    files = sorted(name for name, entry in found.items() if entry.get("type") == "file" and not name.endswith("/"))
    if not files and is_pattern:
        raise UsageError(f"{shown(text)}: no file matches; quote the pattern and check the folder")
    if not files:
        raise UsageError(f"{shown(text)}: there is no such file, and none below it; check the URL")
    return [beside(text, name) for name in files]


def urls_below(text: str) -> list[str]:
    """The files below a prefix, sorted by name; none where there is no such prefix.

    Raises:
        UsageError: see `store`.
        RemoteError: it cannot be listed.
    """
    file_system, path = store(text)
    prefix = f"{path.rstrip('/')}/"
    found = persistently(text, lambda: file_system.find(prefix, detail=True))
    names = (name for name, entry in found.items() if entry.get("type") == "file")
    return [beside(text, name) for name in sorted(names) if name.startswith(prefix) and not name.endswith("/")]


def is_url_folder(text: str) -> bool:
    """Whether a URL names a prefix of files and no file; that of a web server never does.

    Raises:
        UsageError: see `store`.
        RemoteError: there is nothing of that name, or it cannot be asked for.
    """
    if is_web(text):
        return False
    file_system, path = store(text)
    return persistently(text, lambda: file_system.info(path)).get("type") == "directory"


def beside(text: str, name: str) -> str:
    """The URL of another path of a file system in the same bucket or container, named as it is (with its account)."""
    place = text[text.index("://") + 3 :].partition("/")[0]
    return f"{scheme_of(text)}://{place}/{name.strip('/').partition('/')[2]}"
