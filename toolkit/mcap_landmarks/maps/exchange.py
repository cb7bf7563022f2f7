"""Landmark maps from and to files of other formats: the thesis's text, CSV, JSON."""

import json
from enum import StrEnum

from mcap_landmarks import memory
from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.errors import MapError, UsageError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.maps import exchange_csv, exchange_json, exchange_thesis
from mcap_landmarks.maps.model import LandmarkMap


class Format(StrEnum):
    """How a landmark map is written down outside its database."""

    THESIS = "thesis"
    CSV = "csv"
    JSON = "json"


SUFFIXES = {".txt": Format.THESIS, ".csv": Format.CSV, ".json": Format.JSON}
"""What the names of such files end with."""


def format_of(path: Location) -> Format:
    """The format that a file's name stands for.

    Raises:
        UsageError: it stands for none.
    """
    try:
        return SUFFIXES[path.suffix.lower()]
    except KeyError:
        known = ", ".join(f"{suffix} ({form})" for suffix, form in SUFFIXES.items())
        raise UsageError(f"{path}: the name does not tell the format; use {known}, or --format") from None


def import_map(path: Location, form: Format) -> LandmarkMap:
    """The map in a text file.

    Raises:
        MapError: it cannot be read, or is not of that format; says where and what was expected.
    """
    text = read_text(path)
    if problem := memory.excess_of_landmarks(max(text.count("\n"), text.count('"id"'))):
        raise MapError(f"{path}: {problem}")
    if form is Format.THESIS:
        return exchange_thesis.parse_map(text, str(path))
    if form is Format.CSV:
        return exchange_csv.parse(text, str(path))
    return exchange_json.parse(text, str(path))


def export_map(path: Location, landmark_map: LandmarkMap, form: Format) -> None:
    """Write a map to a text file, whole or not at all.

    Raises:
        ToolkitError: the map has not what the format needs, or the file cannot be written.
    """
    if form is Format.THESIS:
        text = exchange_thesis.render_map(landmark_map)
    elif form is Format.CSV:
        text = exchange_csv.render(landmark_map)
    else:
        text = json.dumps(exchange_json.document(landmark_map), indent=2) + "\n"
    with atomic_file(path) as stream:
        stream.write(text.encode())


def read_text(path: Location) -> str:
    """The text of a file, which must be UTF-8.

    Raises:
        MapError: it cannot be read.
    """
    try:
        return to_read(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise MapError(f"{path}: cannot be read ({error.strerror}); name a file with a map or results") from error
    except UnicodeDecodeError as error:
        raise MapError(f"{path}: is not text in UTF-8 (byte {error.start}); save it as that") from error
