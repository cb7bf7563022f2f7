"""Landmark maps as CSV, one landmark a line."""

import csv
import hashlib
import io
import re
from collections.abc import Sequence

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.maps.model import LandmarkMap, MapSource

NEEDED = ("id", "class", "x_m", "y_m")
COLUMNS = (*NEEDED, "var_x_m2", "cov_xy_m2", "var_y_m2", "radius_m", "sightings")
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""How a text begins that a spreadsheet takes for a formula (OWASP, CSV Injection), or that `_as_text` made of one."""


def parse(text: str, name: str) -> LandmarkMap:
    """The map of a CSV text. Its first line names the columns; all after y_m may be left out, zero is unknown.

    Of an id or class that begins with apostrophes and then as a formula does, the first apostrophe is taken away:
    `render` put it there.

    Raises:
        MapError: with the name of the file, the line, and what was expected there.
    """
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(reader, [])
        if not set(NEEDED) <= set(header) <= set(COLUMNS) or len(set(header)) != len(header):
            raise MapError(f"{name}, line 1: expected the columns {','.join(COLUMNS)}, the first four at least")
        rows = [
            (_record(header, row, f"{name}, line {reader.line_num}"), reader.line_num) for row in reader if any(row)
        ]
    except csv.Error as error:
        raise MapError(f"{name}, line {reader.line_num}: is not CSV ({error}); quote texts with commas") from error
    _check_ids([record for record, _ in rows], [line for _, line in rows], name)
    numbers = np.array([record[2] for record, _ in rows], dtype=np.float64).reshape(-1, 7)
    try:
        return LandmarkMap(
            tuple(record[0] for record, _ in rows),
            tuple(record[1] for record, _ in rows),
            numbers[:, :2],
            numbers[:, [2, 3, 3, 4]].reshape(-1, 2, 2),
            numbers[:, 5],
            numbers[:, 6].astype(np.int64),
            np.zeros(len(rows), dtype=np.bool_),
            sources=(MapSource("import", hashlib.sha256(text.encode()).hexdigest()),),
        )
    except MapError as error:
        raise MapError(f"{name}: {error}") from error


def render(landmark_map: LandmarkMap) -> str:
    """The confirmed landmarks of a map as CSV, numbers to the last bit.

    No spreadsheet runs anything of it: ids and classes that begin with = + - @, a tab or a carriage return, or with
    apostrophes before these, get an apostrophe in front, which `parse` takes away again. Numbers stay numbers.
    """
    lines = [_line(COLUMNS)]
    spread = landmark_map.covariances
    for i in np.flatnonzero(~landmark_map.tentative):
        numbers = [*landmark_map.positions_xy[i], spread[i, 0, 0], spread[i, 0, 1], spread[i, 1, 1]]
        names = (_as_text(landmark_map.ids[i]), _as_text(landmark_map.classes[i]))
        texts = [repr(float(number)) for number in (*numbers, landmark_map.radii_m[i])]
        lines.append(_line([*names, *texts, str(int(landmark_map.sightings[i]))]))
    return "".join(lines)


def _line(cells: Sequence[str]) -> str:
    """The cells as a line, those quoted that hold a part of any line break: csv looks for those of its own only."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\r\n").writerow(cells)
    return stream.getvalue()[:-2] + "\n"


Record = tuple[str, str, list[float]]


def _record(header: list[str], row: list[str], where: str) -> Record:
    if len(row) != len(header):
        raise MapError(f"{where}: expected {len(header)} values, found {len(row)}")
    fields = dict(zip(header, row, strict=True))
    if not fields["id"] or not fields["class"]:
        raise MapError(f"{where}: expected an id and a class, found none")
    return _as_meant(fields["id"]), _as_meant(fields["class"]), _numbers(fields, where)


def _as_text(name: str) -> str:
    return f"'{name}" if _FORMULA.match(name) else name


def _as_meant(cell: str) -> str:
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def _numbers(fields: dict[str, str], where: str) -> list[float]:
    numbers = []
    for column in COLUMNS[2:]:
        text = fields.get(column, "") or ("" if column in NEEDED else "0")
        try:
            numbers.append(float(text))
        except ValueError as error:
            raise MapError(f"{where}: expected a number as {column}, found {text!r}") from error
        if not np.isfinite(numbers[-1]):
            raise MapError(f"{where}: expected a finite number as {column}, found {text}")
    if not numbers[-1].is_integer():
        raise MapError(f"{where}: expected a count as sightings, found {fields['sightings']}")
    return numbers


def _check_ids(records: list[Record], lines: list[int], name: str) -> None:
    first: dict[str, int] = {}
    for record, line in zip(records, lines, strict=True):
        if record[0] in first:
            raise MapError(f"{name}, line {line}: the id {record[0]} is also on line {first[record[0]]}")
        first[record[0]] = line
    if not records:
        raise MapError(f"{name}: holds no landmark; expected one a line after the header")
