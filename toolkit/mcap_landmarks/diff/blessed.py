"""Blessed results: the figures of a set of runs, kept in one small file for later runs to be held against."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location

BLESSED = "blessed.json"
"""The file in a folder of blessed results."""
_SCHEMA = "mcap-landmarks/blessed/1"


@dataclass(frozen=True, slots=True)
class BlessedLog:
    """The figures of a log (see `diff.criteria.METRICS`), the fingerprint of its recording, its manifest's entries."""

    name: str
    fingerprint: str | None
    manifest: Mapping[str, str]
    figures: Mapping[str, Annotated[float, Field(allow_inf_nan=False)] | None]


def read_blessed(path: Location) -> list[BlessedLog]:
    """The logs in a file of blessed results.

    Raises:
        RecordingError: it cannot be read, or is none.
    """
    try:
        with path.open("rb") as stream:
            document = json.loads(stream.read().decode("utf-8"))
        if document["schema"] != _SCHEMA:
            raise RecordingError(f"{path}: is {document['schema']} instead of {_SCHEMA}; bless the results anew")
        return TypeAdapter(list[BlessedLog]).validate_python(document["logs"])
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except (ValueError, KeyError, TypeError, RecursionError, ValidationError) as error:
        raise RecordingError(f"{path}: holds no blessed results; bless them anew with --bless") from error


def bless(folder: Location, logs: Sequence[BlessedLog]) -> Location:
    """Keep the figures of logs in a folder, which is made if its parent is there; the file.

    Raises:
        UsageError, RecordingError: it cannot be written.
    """
    if isinstance(folder, Path):
        _make(folder)
    entries = [
        {
            "name": log.name,
            "fingerprint": log.fingerprint,
            "manifest": dict(sorted(log.manifest.items())),
            "figures": dict(log.figures),
        }
        for log in sorted(logs, key=lambda log: log.name)
    ]
    with atomic_file(folder / BLESSED) as stream:
        stream.write(json.dumps({"schema": _SCHEMA, "logs": entries}, indent=1, allow_nan=False).encode() + b"\n")
    return folder / BLESSED


def _make(folder: Path) -> None:
    if not folder.exists() and not folder.parent.is_dir():
        raise UsageError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made a folder ({error.strerror}); choose another place") from error
