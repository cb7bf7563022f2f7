"""How much memory a file may claim: what it declares is checked before anything is allocated for it."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Generic, Protocol, TypeVar, overload

from mcap_landmarks.errors import RecordingError, UsageError

SMALL = 128 << 20
"""So much may be unpacked from anything: the largest uncompressed images and maps of recorders are smaller."""
_RATIO = 64
"""More than this is not unpacked from fewer bytes than it divided by this: robots' messages shrink to a third, plain
images to a hundredth (ecosystem notes: small messages to 31 %), what is made to harm to a ten-thousandth."""
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_MANY = 8 << 20
"""Contents of more bytes than this are not taken apart into objects at once: these are up to 15 times as large."""

_KEPT = 8 << 20
"""The largest chunk whose memory is kept for the next: recorders write chunks of 768 KiB to 4 MiB."""
_LANDMARK = 4 << 10
"""Bytes that a landmark takes at most in one of the verbs (measured with 200,000: import 1.6 KB, show as JSON 4 KB)."""

T = TypeVar("T")
_T_co = TypeVar("_T_co", covariant=True)


class _Bound:
    """What the user said, None for nothing."""

    given: int | None = None


def allow(text: str | None) -> None:
    """Let files claim so much memory from now on, such as 512M or 4G; None for half of the machine's.

    Raises:
        UsageError: the text is no size.
    """
    _Bound.given = size(text, "--max-memory")


def size(text: str | None, option: str) -> int | None:
    """The bytes that an option means, such as 512M or 4G; None where it is not given.

    Raises:
        UsageError: the text is no size.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", (text or "").strip(), re.IGNORECASE)
    if text is not None and (match is None or float(match[1]) == 0):
        raise UsageError(f"{option} {text}: give a size such as 512M or 4G")
    return int(float(match[1]) * _UNITS[match[2].upper()]) if match else None


def bound() -> int:
    """The bytes that one thing of a file may take."""
    return _half_of_all() if _Bound.given is None else _Bound.given


@cache
def _half_of_all() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2


@cache
def bound_images() -> None:
    """Bound what OpenCV decodes, before it is loaded: by itself that is up to 2**30 pixels, also of kinds of images
    whose headers `vision` does not read.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(1 << 26))


@cache
def keep_room() -> None:
    """Let freed chunks leave their memory to the next ones; to get it anew takes as long as to read them.

    What glibc (malloc.c, "dynamic mmap threshold") does with a block that it gives back to the system when it is freed:
    it keeps blocks up to that size from then on, twice as much in all; once for a process, as a second such block would
    be filled with zeros. Elsewhere nothing changes.
    """
    bytes(_KEPT)


def most(given: int, small: int = SMALL) -> int:
    """The bytes that may be made of some given ones: `small` or a plain multiple, unless the user set the bound."""
    return bound() if _Bound.given is not None else min(bound(), max(small, _RATIO * given))


def excess(claimed: int, given: int, small: int = SMALL) -> str | None:
    """Why so many bytes are not made of some given ones, in words; None where they may be."""
    if claimed <= most(given, small):
        return None
    return f"it claims {shown(claimed)} from {shown(given)}; if that is right, allow it with --max-memory"


def check(place: object, claimed: int, given: int, small: int = SMALL) -> None:
    """Refuse what claims too much.

    Raises:
        RecordingError: it does; names the place, such as a file and what in it.
    """
    if problem := excess(claimed, given, small):
        raise RecordingError(f"{place}: {problem}")


def excess_of_landmarks(count: int) -> str | None:
    """Why a map of so many landmarks is not read, in words; None where it may be."""
    if count * _LANDMARK <= bound():
        return None
    return f"{count} landmarks take {shown(count * _LANDMARK)} as objects; if that is right, allow it with --max-memory"


def shown(size: int) -> str:
    """A size as people read it."""
    value, units = float(size), iter(("bytes", "kB", "MB", "GB", "TB"))
    unit = next(units)
    while value >= 1000 and unit != "TB":
        value, unit = value / 1000, next(units)
    return f"{size} bytes" if unit == "bytes" else f"{value:.1f} {unit}"


class _Reader(Protocol):
    def read(self, size: int, /) -> bytes:
        """Give at most so many bytes, none at the end."""


class TooLargeError(ValueError):
    """What was read grew over its bound; the message says so."""


def read_within(stream: _Reader, given: int, limit: int | None = None) -> bytes:
    """All that a decompressor gives, in pieces, so that no claim of its own is believed.

    Raises:
        TooLargeError: more came than may be made of the given bytes, or than `limit`.
    """
    largest = most(given) if limit is None else min(limit, most(given))
    content = bytearray()
    while piece := stream.read(min(1 << 20, largest + 1 - len(content))):
        content += piece
        if len(content) > largest:
            raise TooLargeError(f"it unpacks to more than {shown(largest)}")
    return bytes(content)


def is_small(content: bytes | memoryview) -> bool:
    """Whether a content can be taken apart at once, whatever it holds; else with `Lazily`."""
    return len(content) <= _MANY


class Lazily(Sequence[_T_co], Generic[_T_co]):
    """Many things that are made one by one when they are asked for, from their numbers in `order`."""

    def __init__(self, order: Sequence[int], make: Callable[[int], _T_co]) -> None:
        self._order, self._make = order, make

    def __len__(self) -> int:
        return len(self._order)

    @overload
    def __getitem__(self, index: int, /) -> _T_co: ...
    @overload
    def __getitem__(self, index: slice, /) -> Sequence[_T_co]: ...
    def __getitem__(self, index: int | slice, /) -> "_T_co | Sequence[_T_co]":
        if isinstance(index, slice):
            return Lazily(self._order[index], self._make)
        return self._make(int(self._order[index]))

    def __iter__(self) -> Iterator[_T_co]:
        return (self._make(int(number)) for number in self._order)
