"""Where a file is: a path of this machine or a URL. What a user names is a `Location` until it is opened."""

import glob
import os
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Literal, Protocol
from urllib.parse import unquote, urlsplit

from mcap_landmarks.errors import UsageError
from mcap_landmarks.remote.addresses import URL, check_no_password, scheme_of, shown


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

    def __truediv__(self, name: str, /) -> "Location":
        """What has this name in the folder that this is."""

    def with_name(self, name: str, /) -> "Location":
        """What has this name beside this."""

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

    def __truediv__(self, name: str, /) -> "Url":
        """See `Location`."""
        return Url(f"{self.text.rstrip('/')}/{name}")

    def with_name(self, name: str, /) -> "Url":
        """See `Location`."""
        return Url(f"{self.text[: self.text.rstrip('/').rindex('/')]}/{name}")

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
        UsageError: a file of another host, or it has a password, or a host that nothing can have.
    """
    if not isinstance(text, str) or not URL.match(text):
        return Path(text)
    is_file = scheme_of(text) == "file"
    if not is_file:
        check_no_password(text)
    try:
        parts = urlsplit(text)
    except ValueError as error:
        raise UsageError(f"{shown(text)} is no URL ({error}); check its host") from error
    if not is_file:
        return Url(text)
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


def open_to_read(place: Location) -> BinaryIO:
    """A file, for reading; of one elsewhere only what is read is fetched.

    Raises:
        OSError: a path cannot be read.
        UsageError: it is a pipe or device; or see `Url.open`.
        RemoteError: see `Url.open`.
    """
    return (to_read(place) if isinstance(place, Path) else place).open("rb")


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
        UsageError: nothing of that name is there; or see `Url.open`.
        RemoteError: it cannot be listed.
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


def same_place(one: Location, other: Location) -> bool:
    """Whether two names are of one place: behind links, and with or without a slash at the end of a URL."""
    return address(one) == address(other)


def address(place: Location) -> str:
    """What all names of a place have in common: its path behind links, or its URL."""
    return place.text.rstrip("/") if isinstance(place, Url) else os.path.realpath(str(place))


def files_in(folder: Location) -> list[Location]:
    """What lies in a folder, by name; of a URL all files below it. Nothing where there is no such folder.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(folder, Url):
        from mcap_landmarks.remote.store_listing import urls_below  # noqa: PLC0415 # not loaded for paths

        return [Url(text) for text in urls_below(folder.text)]
    path = to_read(folder)
    return [*sorted(path.iterdir())] if path.is_dir() else []


def is_there(place: Location) -> bool:
    """Whether there is a file of this name, or on this machine anything else.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.uploads import is_stored  # noqa: PLC0415 # not loaded for paths

        return is_stored(place.text)
    return to_read(place).exists()


def check_there(place: Location) -> None:
    """Refuse a URL where nothing lies, before hours of work; of a web server whoever opens it finds out.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(place, Url):
        is_folder(place)


def remove(place: Location) -> None:
    """Remove a file.

    Raises:
        OSError, RemoteError: it cannot be removed.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.uploads import remove_stored  # noqa: PLC0415 # not loaded for paths

        remove_stored(place.text)
    else:
        to_read(place).unlink()


def is_folder(place: Location) -> bool:
    """Whether a folder is named: of a URL, a prefix of files.

    Raises:
        UsageError, RemoteError: see `Url.open`.
    """
    if isinstance(place, Url):
        from mcap_landmarks.remote.store_listing import is_url_folder  # noqa: PLC0415 # not loaded for paths

        return is_url_folder(place.text)
    return to_read(place).is_dir()
