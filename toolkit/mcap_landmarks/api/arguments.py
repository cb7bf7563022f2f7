"""What callers of the Python API may give for files, moments and topics, as the toolkit takes it."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np

from mcap_landmarks.errors import LossWarning
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import time_ns

AnyPath = str | PathLike[str]
Moment = int | np.int64 | str | datetime | np.datetime64
"""Nanoseconds since the epoch, RFC 3339, or a moment; a `datetime` without time zone is refused, NumPy's are in UTC."""


def place(path: AnyPath) -> Location:
    """A file or folder."""
    return location(path if isinstance(path, str) else Path(path))


def maybe_place(path: AnyPath | None) -> Location | None:
    """A file or folder, if one is given."""
    return None if path is None else place(path)


def places(paths: AnyPath | Sequence[AnyPath]) -> list[Location]:
    """One file or several."""
    return [place(paths)] if isinstance(paths, str | PathLike) else [place(path) for path in paths]


def moment_text(given: Moment | None, name: str) -> str | None:
    """A moment as the command line takes it.

    Raises:
        UsageError: a text is not RFC 3339, or there is no time zone.
    """
    found = moment_ns(given, name)
    return None if found is None else str(found)


def moment_ns(given: Moment | None, name: str) -> int | None:
    """Nanoseconds since the epoch; raises as `moment_text`."""
    if isinstance(given, np.datetime64):
        return int(given.astype("datetime64[ns]").astype(np.int64))
    if given is None or isinstance(given, int | np.integer):
        return None if given is None else int(given)
    return time_ns(given.isoformat() if isinstance(given, datetime) else given, name)


def texts(given: str | Sequence[str] | None) -> list[str]:
    """None, one or several."""
    return [given] if isinstance(given, str) else list(given or ())


def pairs(given: Mapping[str, object] | None) -> list[str]:
    """Pairs as the command line has them, such as `FROM=TO`."""
    return [f"{key}={value}" for key, value in (given or {}).items()]


def tell(path: Location, losses: Iterable[str]) -> None:
    """Warn of what could not be read."""
    for loss in losses:
        warnings.warn(f"{path}: {loss}", LossWarning, stacklevel=4)
