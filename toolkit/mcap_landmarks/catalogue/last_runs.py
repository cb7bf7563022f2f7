"""The last run of each log in a catalogue, for what takes a set of results."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

from mcap_landmarks.catalogue.catalogue_columns import Row
from mcap_landmarks.catalogue.catalogue_file import NoCatalogueError, read_catalogue
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import Location, is_there, location

_WITHOUT_RESULTS = ("convert", "evaluate")
"""Verbs whose outputs are logs without results, and figures of results that a run before wrote."""
_EVER = datetime.min.replace(tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class LastRun:
    """A log, where the output of its last run is, and why there is none: then `error` names both."""

    log: str
    name: str
    output: Location | None
    error: str | None = None


def last_runs(place: Location) -> list[LastRun]:
    """The last run of each log that made results, by log; outputs that are gone are told as errors.

    A name is the output's path from the folder that holds all outputs, without suffix.

    Raises:
        UsageError, RecordingError: there is no such catalogue, it cannot be read, or it has no such run.
    """
    if not is_there(place):
        raise RecordingError(f"{place}: there is no such file; check the path")
    try:
        rows = [row for row in read_catalogue(place).rows if row["verb"] not in _WITHOUT_RESULTS]
    except NoCatalogueError as error:
        if place.suffix.lower() == ".parquet":
            raise
        raise RecordingError(
            f"{place}: is neither a landmark database nor a catalogue{error.reason}; name one that map or "
            "batch --catalogue wrote"
        ) from error
    if not rows:
        raise RecordingError(
            f"{place}: has no run that made results; name a catalogue of localize, map or other stages"
        )
    last = {str(row["log"]): row for row in sorted(rows, key=_started)}
    outputs = {log: str(row["output"]) for log, row in last.items() if row["output"] is not None}
    names = _names(outputs)
    return [_last_run(place, log, names.get(log, PurePosixPath(log).stem), last[log]) for log in sorted(last)]


def kept_as(place: Path | Location, catalogue: Location) -> str:
    """What a catalogue has of a place: a path that is not absolute as seen from the catalogue's own folder."""
    if not isinstance(place, Path) or place.is_absolute():
        return str(place)
    if not isinstance(catalogue, Path):
        return str(place.absolute())
    return os.path.relpath(place, catalogue.parent)


def _started(row: Row) -> datetime:
    return row["started"] if isinstance(row["started"], datetime) else _EVER


def _names(outputs: Mapping[str, str]) -> dict[str, str]:
    """Names of outputs by log: their paths without the folder that is common to all."""
    paths = {log: PurePosixPath(text) for log, text in outputs.items()}
    folders = {path.parent.parts for path in paths.values()}
    common = next((i for i, parts in enumerate(zip(*folders, strict=False)) if len({*parts}) > 1), None)
    if common is None:
        common = min(map(len, folders), default=0)
    return {log: PurePosixPath(*path.parts[common:]).with_suffix("").as_posix() for log, path in paths.items()}


def _last_run(place: Location, log: str, name: str, row: Row) -> LastRun:
    if row["output"] is None:
        why = str(row["errors"] or row["outcome"]).splitlines()[0].removeprefix("error: ")
        return LastRun(log, name, None, f"{log}: its last run left no output: {why}")
    output = location(str(row["output"]))
    if isinstance(output, Path) and not output.is_absolute():
        output = place.parent / output if isinstance(place, Path) else place.with_name(output.as_posix())
    if not is_there(output):
        return LastRun(log, name, None, f"{output}: is gone, which the last run of {log} wrote; run it again")
    return LastRun(log, name, output)
