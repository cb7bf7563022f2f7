"""Catalogues as files: reading one, and appending the rows of a run to it."""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from mcap_landmarks.atomic import HeldError, atomic_file, check_target, held
from mcap_landmarks.catalogue.application_ids import AT, LANDMARKS
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


class NoCatalogueError(RecordingError):
    """A file is no catalogue, for a `reason` that reads on from that."""

    def __init__(self, place: Location, reason: str) -> None:
        super().__init__(f"{place}: is no catalogue{reason}; name one that batch --catalogue wrote")
        self.reason = reason


def is_catalogue(place: Location) -> bool:
    """Whether a file is to be read as a catalogue: by its suffix, unless it is or should be a landmark database.

    What is neither counts as one: reading it says what is wrong.
    """
    suffix = place.suffix.lower()
    if suffix not in _FORMATS or suffix == ".parquet":
        return suffix in _FORMATS
    if not is_there(place):
        return suffix != ".db"
    try:
        with place.open("rb") as stream:
            return stream.read(AT + len(LANDMARKS))[AT:] != LANDMARKS
    except OSError:
        return False  # opening it says what is wrong


def read_catalogue(place: Location) -> Catalogue:
    """A catalogue's rows, in the order in which they were written; no rows and columns where there is none yet.

    Raises:
        UsageError: its name says no format, or it needs pyarrow.
        RecordingError: it cannot be read.
        NoCatalogueError: it is none.
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
        raise NoCatalogueError(place, f" ({error})") from error
    lacking = [name for name in NEEDED if name not in table.columns]
    if lacking:
        raise NoCatalogueError(place, f", as it has no column {lacking[0]}")
    wrong = [name for name in NEEDED if table.columns[name] != COLUMNS[name]]
    if wrong:
        raise NoCatalogueError(place, f", as its column {wrong[0]} is of another type")
    return table


def check_catalogue(place: Location) -> None:
    """Refuse what no rows can be appended to, before anything runs.

    Raises:
        UsageError: its name says no format, it cannot be written, what is there is no catalogue, or it needs pyarrow.
        RecordingError: what is there cannot be read.
    """
    _format_of(place)
    check_target(place)
    try:
        _check_kinds(place, read_catalogue(place))
    except NoCatalogueError as error:
        raise UsageError(str(error)) from error


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
            raise NoCatalogueError(place, f", as its column {name} is of another type")
