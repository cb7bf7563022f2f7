"""Where a file is: a path of this machine or a URL. What a user names is a `Location` until it is opened."""

import glob
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Literal, Protocol
from urllib.parse import unquote, urlsplit

from mcap_landmarks.errors import UsageError
from mcap_landmarks.remote.addresses import URL, scheme_of, shown


class Location(Protocol):
    """A file or folder that a user named: a `Path` is one, and so is a `Url`. `str` shows it as it was written,
    without credentials.
    """

    @property
    def name(self) -> str:
        """The last part."""

    @property
    def stem(self) -> str:
        """The name without its suffix."""

    @property
    def suffix(self) -> str:
        """The name's ending with its dot, empty if it has none."""

    def open(self, mode: Literal["rb"], /) -> BinaryIO:
        """The file, for reading.

        Raises:
            OSError: as for paths.
            UsageError: it cannot be read from here.
        """


@dataclass(frozen=True, slots=True)
class Url:
    """A file elsewhere. `text` may hold credentials: it is for who opens it; `str` and `repr` show none."""

    text: str = field(repr=False)

    def __str__(self) -> str:
        return shown(self.text)

    def __repr__(self) -> str:
        return f"Url({shown(self.text)!r})"

    @property
    def _path(self) -> PurePosixPath:
        return PurePosixPath(urlsplit(self.text).path)

    @property
    def name(self) -> str:
        """See `Location`; a query is no part of it."""
        return self._path.name

    @property
    def stem(self) -> str:
        """See `Location`."""
        return self._path.stem

    @property
    def suffix(self) -> str:
        """See `Location`."""
        return self._path.suffix

    def open(self, mode: Literal["rb"], /) -> BinaryIO:  # noqa: ARG002 # the one that `Location` has
        """See `Location`; only what is read is fetched.

        Raises:
            RemoteError: there is no such file, or it cannot be read.
            UsageError: the scheme is unknown, or the library for it not installed.
        """
        from mcap_landmarks.remote.local_copies import open_url  # noqa: PLC0415 # not loaded for paths

        return open_url(self.text)


def location(text: str | Path) -> Location:
    """What a user named: a URL if it has a scheme and `://`, else a path. A default is a path already.

    What `file://` names is a path, too (RFC 8089).

    Raises:
        UsageError: a file of another host.
    """
    if not isinstance(text, str) or not URL.match(text):
        return Path(text)
    if scheme_of(text) != "file":
        return Url(text)
    parts = urlsplit(text)
    if parts.netloc not in {"", "localhost"}:
        raise UsageError(f"{shown(text)} is a file of another host; write file:///PATH, or the URL of a server")
    return Path(unquote(parts.path))


def to_read(place: Location) -> Path:
    """The path of a file or folder, for what reads paths only; one that does not exist is refused by who opens it.

    Of a file elsewhere that is a copy, made once; see `remote.local_copies`.

    Raises:
        UsageError: it is a pipe or device, which could not be read twice; or see `Url.open`.
        RemoteError: it cannot be copied.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.local_copies import local_copy  # noqa: PLC0415 # not loaded for paths

        return local_copy(place.text)
    if not isinstance(place, Path):
        raise TypeError(f"{place!r} is no location")
    if place.exists() and not (place.is_file() or place.is_dir()):
        raise UsageError(f"{place} is neither a file nor a folder; save what it gives to a file first")
    return place


def to_write(place: Location) -> Path:
    """The path of a file or folder that is made or replaced.

    Raises:
        UsageError: it is not on this machine.
    """
    if isinstance(place, Path):
        return place
    raise UsageError(f"{place}: URLs cannot be written yet; write to a file and upload that")


def size_of(place: Location) -> int:
    """Bytes of a file; 0 where there is none on this machine, since opening it says what is wrong.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.local_copies import size_of_url  # noqa: PLC0415 # not loaded for paths

        return size_of_url(place.text)
    path = to_read(place)
    return path.stat().st_size if path.is_file() else 0


def matching(place: Location) -> list[Location]:
    """What a pattern (`**` is any depth) or a URL's prefix names, sorted by name; what is there is named by itself.

    Raises:
        UsageError: a pattern that no path fits; or see `Url.open`.
        RemoteError: there is no such file elsewhere, nor any below it.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.store_listing import urls_matching  # noqa: PLC0415 # not loaded for paths

        return [Url(text) for text in urls_matching(place.text)]
    path = to_read(place)
    # Path.glob takes no absolute pattern.
    found = [str(path)] if path.exists() else sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
    if not found:
        raise UsageError(f"{place}: no file matches; quote the pattern and check the folder")
    return [Path(name) for name in found]


def is_folder(place: Location) -> bool:
    """Whether a folder is named: of a URL, a prefix of files.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.store_listing import is_url_folder  # noqa: PLC0415 # not loaded for paths

        return is_url_folder(place.text)
    return to_read(place).is_dir()
