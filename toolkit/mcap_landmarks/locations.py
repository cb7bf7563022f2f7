"""Where a file is: a path of this machine or a URL. What a user names is a `Location` until it is opened."""

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Literal, Protocol
from urllib.parse import urlsplit

from mcap_landmarks.errors import UsageError

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")  # RFC 3986, section 3.1; a single letter is a drive


class Location(Protocol):
    """A file or folder that a user named: a `Path` is one, and so is a `Url`. `str` shows it as it was written."""

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
    """A file elsewhere; nothing can be read there yet."""

    text: str

    def __str__(self) -> str:
        return self.text

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

    def open(self, mode: Literal["rb"], /) -> BinaryIO:
        """See `Location`."""
        return to_read(self).open(mode)


def location(text: str | Path) -> Location:
    """What a user named: a URL if it has a scheme and `://`, else a path. A default is a path already."""
    return Url(text) if isinstance(text, str) and _URL.match(text) else Path(text)


def to_read(place: Location) -> Path:
    """The path of a file or folder, for what reads paths only; one that does not exist is refused by who opens it.

    Raises:
        UsageError: it is not on this machine, or it is a pipe or device, which could not be read twice.
    """
    if not isinstance(place, Path):
        raise UsageError(f"{place}: URLs cannot be read yet; download it first")
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
    """Bytes of a file; 0 where there is none, since opening it says what is wrong.

    Raises:
        UsageError: it is not on this machine.
    """
    path = to_read(place)
    return path.stat().st_size if path.is_file() else 0
