"""A catalogue as an SQLite database with the one table `runs`; times are texts in RFC 3339."""

import contextlib
import sqlite3
from datetime import UTC, datetime

from mcap_landmarks.catalogue.catalogue_columns import COLUMNS, Catalogue, Kind, Value

_MAGIC = b"SQLite format 3\0"
_TYPES: dict[Kind, str] = {"text": "TEXT", "integer": "INTEGER", "number": "REAL", "time": "TIMESTAMP"}
_SELECTED: dict[str, Kind] = {"INT": "integer"}
"""What SQLite calls a type in a table that it made of a selection, where that is another name; times it forgets."""


def from_sqlite(content: bytes) -> Catalogue:
    """The table `runs` of a database.

    Raises:
        ValueError: it is none, or has no such table.
    """
    if not content.startswith(_MAGIC):
        raise ValueError("it is no SQLite database")
    try:
        with contextlib.closing(sqlite3.connect(":memory:")) as database:
            database.deserialize(content)
            declared = {name: text for _, name, text, *_ in database.execute("PRAGMA table_info(runs)")}
            rows = database.execute("SELECT * FROM runs").fetchall()
    except sqlite3.Error as error:
        raise ValueError(str(error)) from error
    kinds = {**{text: kind for kind, text in _TYPES.items()}, **_SELECTED}
    columns = {name: kinds.get(text.upper(), COLUMNS.get(name, "text")) for name, text in declared.items()}
    read = [{name: _read(columns[name], value) for name, value in zip(columns, row, strict=True)} for row in rows]
    return Catalogue(columns, read)


def to_sqlite(table: Catalogue) -> bytes:
    """A table as a database; every column may be null. Same table, same bytes."""
    declared = ", ".join(f"{_quoted(name)} {_TYPES[kind]}" for name, kind in table.columns.items())
    marks = ", ".join("?" for _ in table.columns)
    rows = ([_written(row[name]) for name in table.columns] for row in table.rows)
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as database:
        database.execute("BEGIN")
        database.execute(f"CREATE TABLE runs ({declared})")
        database.executemany(f"INSERT INTO runs VALUES ({marks})", rows)  # noqa: S608 - question marks alone
        database.execute("COMMIT")
        return database.serialize()


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _read(kind: Kind, value: str | int | float | None) -> Value:
    if kind == "time" and isinstance(value, str):
        return datetime.fromisoformat(value)
    return value


def _written(value: Value) -> str | int | float | None:
    return value.astimezone(UTC).isoformat(timespec="microseconds") if isinstance(value, datetime) else value
