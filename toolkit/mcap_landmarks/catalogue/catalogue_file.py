"""Catalogues as files: reading one, and appending the rows of a run to it."""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from mcap_landmarks.atomic import HeldError, atomic_file, check_target, held
from mcap_landmarks.catalogue.catalogue_columns import COLUMNS, NEEDED, Catalogue, Row
from mcap_landmarks.catalogue.parquet_file import from_parquet, need_pyarrow, to_parquet
from mcap_landmarks.catalogue.sqlite_file import from_sqlite, to_sqlite
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location, is_there

_PATIENCE_S = 60.0
"""A catalogue of a million rows is written in less; who holds it for longer hangs."""


class _Format(NamedTuple):
    read: Callable[[bytes], Catalogue]
    write: Callable[[Catalogue], bytes]


_PARQUET, _SQLITE = _Format(from_parquet, to_parquet), _Format(from_sqlite, to_sqlite)
_FORMATS = {".parquet": _PARQUET, ".db": _SQLITE, ".sqlite": _SQLITE}


def is_catalogue(place: Location) -> bool:
    """Whether a file is a catalogue: by its suffix, and by its table where that is one of landmark databases, too."""
    if place.suffix.lower() not in _FORMATS:
        return False
    if place.suffix.lower() == ".parquet":
        return True
    with contextlib.suppress(RecordingError):
        return bool(read_catalogue(place).columns)
    return False


def read_catalogue(place: Location) -> Catalogue:
    """A catalogue's rows, in the order in which they were written; no rows and columns where there is none yet.

    Raises:
        UsageError: its name says no format, or it needs pyarrow.
        RecordingError: it cannot be read, or is no catalogue.
    """
    format_ = _format_of(place)
    if not is_there(place):
        return Catalogue({}, ())
    try:
        with place.open("rb") as stream:
            content = stream.read()
    except OSError as error:
        raise RecordingError(f"{place}: cannot be read ({error.strerror or error}); check the path") from error
    try:
        table = format_.read(content)
    except (ValueError, OSError) as error:  # the latter is pyarrow's, too
        raise RecordingError(f"{place}: is no catalogue ({error}); name one that batch --catalogue wrote") from error
    lacking = [name for name in NEEDED if name not in table.columns]
    if lacking:
        raise RecordingError(f"{place}: is no catalogue, as it has no column {lacking[0]}; name one of a batch")
    return table


def check_catalogue(place: Location) -> None:
    """Refuse what no rows can be appended to, before anything runs.

    Raises:
        UsageError: its name says no format, it cannot be written, or it needs pyarrow.
        RecordingError: what is there is no catalogue.
    """
    _format_of(place)
    check_target(place)
    _check_kinds(place, read_catalogue(place))


def append_rows(place: Location, rows: Iterable[Row]) -> None:
    """Write a catalogue anew, with rows behind those that it has; it is whole at any time.

    Other batches of this machine may append to it at the same time: each waits for the others.

    Raises:
        UsageError, RecordingError: see `check_catalogue`.
    """
    with _held_in_time(place):
        table = read_catalogue(place)
        _check_kinds(place, table)
        content = _format_of(place).write(table.with_rows(rows))
        with atomic_file(place) as stream:
            stream.write(content)


@contextlib.contextmanager
def _held_in_time(place: Location) -> Iterator[None]:
    """Hold a catalogue as soon as nobody else does."""
    end = time.monotonic() + _PATIENCE_S
    with contextlib.ExitStack() as stack:
        while True:
            try:
                stack.enter_context(held(place))
                break
            except HeldError:
                if time.monotonic() > end:
                    raise
            time.sleep(0.05)
        yield


def _format_of(place: Location) -> _Format:
    format_ = _FORMATS.get(place.suffix.lower())
    if format_ is None:
        raise UsageError(f"{place}: a catalogue is named {', '.join(_FORMATS)}; choose one of these endings")
    if format_ is _PARQUET:
        need_pyarrow()
    return format_


def _check_kinds(place: Location, table: Catalogue) -> None:
    for name, kind in table.columns.items():
        if COLUMNS.get(name, kind) != kind:
            raise RecordingError(f"{place}: its column {name} is of another type; name another file")
