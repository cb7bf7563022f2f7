"""A fleet's manifest: a TOML file that lists logs with what each of them needs beside the options of all."""

import dataclasses
import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, TypeVar

from pydantic import Strict, TypeAdapter, ValidationError

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.moments import time_ns

_T = TypeVar("_T", "ManifestFile", "LoggedEntry")
Moment = Annotated[datetime, Strict()] | str | Annotated[int, Strict()]
"""A time as TOML has it, as RFC 3339 in quotation marks, or as nanoseconds."""
OptionValue = bool | int | float | str | list[str | int | float]
"""What an option's value may be: `true` sets a flag, a list repeats the option."""


@dataclass(frozen=True, slots=True)
class LoggedEntry:
    """A table `[[log]]`."""

    path: str
    name: str | None = None
    start: Moment | None = None
    end: Moment | None = None
    options: dict[str, OptionValue] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ManifestFile:
    """The whole file; the tables of its logs are looked at one by one."""

    log: list[dict[str, object]]
    options: dict[str, OptionValue] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ListedLog:
    """A log of a manifest with all its options, `start` and `end` among them: its own, then those of the file.

    `where` names the file and the table, `origins` the file, table and key of each option.
    """

    entry: LoggedEntry
    where: str
    options: dict[str, OptionValue]
    origins: dict[str, str]


def read_fleet_manifest(file: Location) -> list[ListedLog]:
    """The logs of a manifest.

    Raises:
        UsageError: the file is none, or a table, key or value of it is none of a manifest.
    """
    try:
        with file.open("rb") as stream:
            content = tomllib.load(stream)
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{file}: not a TOML file: {error}; correct it, or name the logs instead") from error
    whole = _checked(ManifestFile, content, str(file), "log is missing; list the logs, each below a line [[log]]")
    if not whole.log:
        raise UsageError(f"{file}: log is empty; list the logs, each below a line [[log]]")
    entries = []
    for number, table in enumerate(whole.log, 1):
        where = f"{file}: [[log]] {number}"
        entry = _checked(LoggedEntry, table, where, 'path is missing; name the log, such as path = "monday.mcap"')
        if entry.name is not None and ("/" in entry.name or entry.name in {"", ".", ".."}):
            raise UsageError(f"{where}: name = {entry.name!r}: give the output's name without folders and suffix")
        times = {key: _written(value, f"{where}: {key}") for key, value in _times(entry) if value is not None}
        origins = {
            **{key: f"{file}: [options]: {key}" for key in whole.options},
            **{key: f"{where}: {key}" for key in times},
            **{key: f"{where}: options.{key}" for key in entry.options},
        }
        entries.append(ListedLog(entry, where, {**whole.options, **times, **entry.options}, origins))
    return entries


def words_of(options: Mapping[str, object]) -> tuple[str, ...]:
    """Options as a command line has them."""
    words: list[str] = []
    for name, value in options.items():
        if isinstance(value, bool):
            words += [f"--{name}"] if value else []
            continue
        for one in value if isinstance(value, list) else [value]:
            words += [f"--{name}", str(one)]
    return tuple(words)


def _times(entry: LoggedEntry) -> tuple[tuple[str, Moment | None], ...]:
    return ("start", entry.start), ("end", entry.end)


def _written(value: Moment, where: str) -> str:
    """A time as the command line has it, which is refused here if it is none."""
    text = value.isoformat() if isinstance(value, datetime) else str(value)
    time_ns(text, f"{where} =")
    return text


def _checked(declared: type[_T], table: Mapping[str, object], where: str, lacking: str) -> _T:
    """A table as what it is declared to be; `lacking` says what its one required key is for."""
    keys = [one.name for one in dataclasses.fields(declared)]
    for key in table:
        if key not in keys:
            near = difflib.get_close_matches(key, keys, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(keys)}"
            raise UsageError(f"{where}: {key} is no key of a manifest; {hint}")
    if keys[0] not in table:
        raise UsageError(f"{where}: {lacking}")
    try:
        return TypeAdapter(declared).validate_python(dict(table))
    except ValidationError as error:
        first = error.errors()[0]
        depth = 2 if first["loc"][0] == "options" else 1  # below, pydantic names the types that it tried
        key = ".".join(map(str, first["loc"][:depth]))
        raise UsageError(f"{where}: {key} = {first['input']!r}: {_EXPECTED[str(first['loc'][0])]}") from error


_EXPECTED = {
    "log": "list the logs, each below a line [[log]]",
    "options": 'give a table of the options without dashes, such as options = { map = "site.db", force = true }',
    "path": 'name a log in quotation marks, such as path = "monday.mcap"',
    "name": "give the output's name in quotation marks, without folders and suffix",
    "start": "give RFC 3339 with an offset, such as 2026-01-31T12:00:00Z, or nanoseconds",
    "end": "give RFC 3339 with an offset, such as 2026-01-31T12:00:00Z, or nanoseconds",
}
"""What each key takes, and so what to do where it has something else."""
