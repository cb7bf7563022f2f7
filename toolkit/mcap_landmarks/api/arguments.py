"""What callers of the Python API may give for files, moments and topics, as the toolkit takes it."""

import inspect
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np

from mcap_landmarks.errors import LossWarning, UsageError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import time_ns

AnyPath = str | PathLike[str]
Moment = int | np.int64 | str | datetime | np.datetime64
"""Nanoseconds since the epoch, RFC 3339, or a moment; a `datetime` without time zone is refused, NumPy's are in UTC."""


_PACKAGE = str(Path(__file__).parents[1]) + os.sep


def place(path: AnyPath, name: str) -> Location:
    """A file or folder; `name` is the argument's.

    Raises:
        UsageError: it is no path.
    """
    given: object = os.fspath(path) if isinstance(path, PathLike) else path
    if not isinstance(given, str):
        raise UsageError(f"{name} is of type {type(path).__name__}; give the path of a file or folder, as str or Path")
    return location(path if isinstance(path, str) else Path(path))


def maybe_place(path: AnyPath | None, name: str) -> Location | None:
    """A file or folder, if one is given; raises as `place`."""
    return None if path is None else place(path, name)


def places(paths: AnyPath | Sequence[AnyPath], name: str) -> list[Location]:
    """One file or several; raises as `place`."""
    if isinstance(paths, str | PathLike) or not isinstance(paths, Iterable):
        return [place(paths, name)]
    return [place(path, name) for path in paths]


def moment_text(given: Moment | None, name: str) -> str | None:
    """A moment as the command line takes it.

    Raises:
        UsageError: it is no moment, a text is not RFC 3339, or there is no time zone.
    """
    found = moment_ns(given, name)
    return None if found is None else str(found)


def moment_ns(given: Moment | None, name: str) -> int | None:
    """Nanoseconds since the epoch; raises as `moment_text`."""
    if given is None:
        return None
    if isinstance(given, np.datetime64) and not np.isnat(given):
        return int(given.astype("datetime64[ns]").astype(np.int64))
    if isinstance(given, int | np.integer) and not isinstance(given, bool | np.timedelta64):  # which are integers too
        return int(given)
    return time_ns(given.isoformat() if isinstance(given, datetime) else str(given), name)


def texts(given: str | Sequence[str] | None) -> list[str]:
    """None, one or several."""
    return [given] if isinstance(given, str) else list(given or ())


def pairs(given: Mapping[str, object] | None, name: str) -> list[str]:
    """Pairs as the command line has them, such as `FROM=TO`.

    Raises:
        UsageError: it is no mapping.
    """
    if not isinstance(given, Mapping | None):
        raise UsageError(f"{name} {given!r} is no mapping; give a dict")
    return [f"{key}={value}" for key, value in (given or {}).items()]


def tell(path: Location, losses: Iterable[str]) -> None:
    """Warn of what could not be read, at the line that called the toolkit."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    for loss in losses:
        warnings.warn(f"{path}: {loss}", LossWarning, stacklevel=level)
