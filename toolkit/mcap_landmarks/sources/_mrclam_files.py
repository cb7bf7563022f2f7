"""The text tables of an MRCLAM data set, from a folder or a zip, with what is wrong in them counted."""

import math
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks import memory
from mcap_landmarks.errors import RecordingError

_ROBOT = re.compile(r"Robot(\d+)_(Odometry|Measurement|Groundtruth)\.dat")
_COLUMNS = {"Odometry": 3, "Measurement": 4, "Groundtruth": 4}
"""How many columns a table has, the time among them, as the data set's page says (Leung et al. 2011)."""
_SMALL_TABLE = 16 << 20
"""A table of so many bytes is taken out of any zip: those of the data set have up to 5 MB, and shrink to a quarter."""
Array = NDArray[np.float64]


@dataclass(slots=True)
class MrclamTable:
    """Rows of one file by time: `time_ns` (N,) and the other columns `values` (N, columns - 1).

    dropped: rows left out, by reason. notes: what else was mended. losses: what could not be understood.
    """

    time_ns: NDArray[np.int64]
    values: Array
    size_bytes: int
    dropped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)


class DataSet:
    """The files of a data set by their names."""

    def __init__(self, path: Path, contents: "zipfile.ZipFile | Path", names: dict[str, str]) -> None:
        self.path = path
        self._contents, self._names = contents, names

    def robots(self) -> list[int]:
        """Numbers of the robots that have a file."""
        return sorted({int(match[1]) for name in self._names if (match := _ROBOT.fullmatch(name))})

    def table(self, robot: int, content: str) -> MrclamTable | None:
        """A robot's `Odometry`, `Measurement` or `Groundtruth`, None if there is no such file."""
        name = f"Robot{robot}_{content}.dat"
        return _timed(name, self._read(name), _COLUMNS[content]) if name in self._names else None

    def numbers(self, name: str, columns: int) -> list[list[float]] | None:
        """Rows of a file without time stamps, None if there is no such file.

        Raises:
            RecordingError: a row cannot be understood; these files are short and everything hangs on them.
        """
        if name not in self._names:
            return None
        rows, bad, _ = _rows(self._read(name), columns)
        if bad or not all(math.isfinite(value) for row in rows for value in row):
            raise RecordingError(
                f"{self.path}: {name} has rows that are not {columns} numbers; mend or download it again"
            )
        return rows

    def _read(self, name: str) -> str:
        where = self._names[name]
        if isinstance(self._contents, zipfile.ZipFile):
            about = self._contents.getinfo(where)
            memory.check(f"{self.path}: {where}", about.file_size, about.compress_size, _SMALL_TABLE)
        try:
            data = (
                self._contents.read(where)
                if isinstance(self._contents, zipfile.ZipFile)
                else (self._contents / where).read_bytes()
            )
        except (zipfile.BadZipFile, OSError, EOFError, zlib.error, NotImplementedError, RuntimeError) as error:
            raise RecordingError(f"{self.path}: {where} cannot be read ({error}); download it again") from error
        return data.decode(errors="replace")


@contextmanager
def open_data_set(path: Path) -> Iterator[DataSet]:
    """The files of a folder or a zip.

    Raises:
        RecordingError: the zip is damaged.
    """
    if path.is_dir():
        yield DataSet(path, path, _by_name(_folder_files(path)))
        return
    try:
        with zipfile.ZipFile(path) as archive:
            yield DataSet(path, archive, _by_name(archive.namelist()))
    except zipfile.BadZipFile as error:
        raise RecordingError(f"{path} is a damaged zip ({error}); download it again") from error


def file_names(path: Path) -> set[str]:
    """Names of the data files at a path, none if it cannot be opened."""
    if path.is_dir():
        return set(_by_name(_folder_files(path)))
    with suppress(zipfile.BadZipFile, OSError), zipfile.ZipFile(path) as archive:
        return set(_by_name(archive.namelist()))
    return set()


def _folder_files(path: Path) -> list[str]:
    """Files of the folder, or of a folder in it, as unpacking a zip often leaves them."""
    return [str(file.relative_to(path)) for pattern in ("*.dat", "*/*.dat") for file in sorted(path.glob(pattern))]


def _by_name(paths: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for path in paths:
        found.setdefault(PurePosixPath(path).name, path)
    return found


def _rows(text: str, columns: int) -> tuple[list[list[float]], int, bool]:
    """Rows of numbers, how many lines are none, and whether the last line is one of these."""
    rows, bad, last_bad = [], 0, False
    for line in text.splitlines():
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        last_bad = len(row) != columns
        if last_bad:
            bad += 1
        else:
            rows.append(row)
    return rows, bad, last_bad


def _timed(name: str, text: str, columns: int) -> MrclamTable:
    rows, bad, cut = _rows(text, columns)
    values = np.array(rows, dtype=np.float64).reshape(-1, columns)
    finite = np.isfinite(values).all(axis=1) & (np.abs(values[:, 0]) < 9e9)
    values = values[finite]
    # The files have milliseconds; a double holds microseconds of the epoch exactly enough.
    time_ns = np.round(values[:, 0] * 1e6).astype(np.int64) * 1000
    table = MrclamTable(time_ns, values[:, 1:], len(text))
    if not finite.all():
        table.dropped[f"{name}: not finite"] = int((~finite).sum())
    if bad:
        where = "the file is cut in its last line" if cut and bad == 1 else f"{bad} lines are not {columns} numbers"
        table.losses.append(f"{name}: {where}")
    backwards = int((np.diff(time_ns) < 0).sum())
    if backwards:
        table.notes.append(f"{name}: time goes backwards {backwards} times; the rows were sorted by time")
        order = np.argsort(time_ns, kind="stable")
        table.time_ns, table.values = time_ns[order], table.values[order]
    return table


def keep(table: MrclamTable, mask: NDArray[np.bool_], reason: str) -> None:
    """Leave out the rows outside the mask and count them."""
    left_out = int((~mask).sum())
    if left_out:
        table.dropped[reason] += left_out
        table.time_ns, table.values = table.time_ns[mask], table.values[mask]
