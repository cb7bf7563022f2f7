"""Columns of many CDR messages of one type, and the parts that read them: no object per message."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError

_LENGTH = Struct("<I")
_MOMENT = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])


class Kind(Enum):
    """What the values of a column are. A `TIME` is in nanoseconds."""

    NUMBER = auto()
    QUATERNION = auto()
    TIME = auto()
    TEXT = auto()


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One field of N rows: values (N, k), objects (bytes) for texts; with `counts` (N,), values (sum of counts, k)."""

    kind: Kind
    values: NDArray[Any]
    counts: NDArray[np.int64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns by dotted path, and the elements of sequences of messages: how many each row has, and their table."""

    rows: int
    columns: dict[str, Column]
    children: "dict[str, tuple[NDArray[np.int64], Table]]"


@dataclass(slots=True)
class Numbers:
    """Numbers of one scalar type: `count` a row, in several fields, or (None) as many as the row says."""

    dtype: np.dtype[np.number]
    count: int | None
    width: int = 1
    fields: list[tuple[str, Kind, int, int]] = field(default_factory=list)
    slices: list[bytes] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        """See `Rows`."""
        count = self.count
        if count is None:
            count, position = _length(data, position)
            self.counts.append(count)
            count *= self.width
            if not count:  # nothing follows, not even padding
                return position
        size = self.dtype.itemsize
        position = (position + size - 1) & -size
        end = position + count * size
        self.slices.append(data[position:end])
        return end

    def take(self, rows: int, table: Table) -> None:
        """Add what was read to a table of so many rows."""
        values = np.frombuffer(b"".join(self.slices), self.dtype)
        values = values.view(np.uint8) if self.dtype == np.bool_ else values  # truths are compared like numbers
        if self.count is None:
            counts = np.array(self.counts, dtype=np.int64)
            ((path, kind, _, _),) = self.fields
            table.columns[path] = Column(kind, values.reshape(-1, self.width), counts)
            return
        values = values.reshape(rows, self.count)
        for path, kind, start, stop in self.fields:
            table.columns[path] = Column(kind, values[:, start:stop])


@dataclass(slots=True)
class Moments:
    """A time or duration."""

    path: str
    slices: list[bytes] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        """See `Rows`."""
        position = (position + 3) & -4
        self.slices.append(data[position : position + 8])
        return position + 8

    def take(self, rows: int, table: Table) -> None:
        """Add what was read to a table of so many rows."""
        pairs = np.frombuffer(b"".join(self.slices), _MOMENT)
        time_ns = pairs["sec"].astype(np.int64) * 10**9 + pairs["nanosec"]
        table.columns[self.path] = Column(Kind.TIME, time_ns.reshape(rows, 1))


@dataclass(slots=True)
class Text:
    """One text."""

    path: str
    found: list[bytes] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        """See `Rows`."""
        text, position = _text(data, position)
        self.found.append(text)
        return position

    def take(self, _rows: int, table: Table) -> None:
        """Add what was read to a table."""
        table.columns[self.path] = Column(Kind.TEXT, _objects(self.found))


@dataclass(slots=True)
class Texts:
    """Texts: `count` a row, or (None) as many as the row says."""

    path: str
    count: int | None
    found: list[bytes] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        """See `Rows`."""
        count = self.count
        if count is None:
            count, position = _length(data, position)
        self.counts.append(count)
        for _ in range(count):
            text, position = _text(data, position)
            self.found.append(text)
        return position

    def take(self, _rows: int, table: Table) -> None:
        """Add what was read to a table."""
        counts = np.array(self.counts, dtype=np.int64)
        table.columns[self.path] = Column(Kind.TEXT, _objects(self.found), counts)


@dataclass(slots=True)
class Children:
    """Messages within a message: `count` a row, or (None) as many as the row says."""

    path: str
    count: int | None
    rows: "Rows"
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        """See `Rows`."""
        count = self.count
        if count is None:
            count, position = _length(data, position)
        if count > len(data):  # every element takes a byte at least
            raise MessageError(f"{self.path} claims {count} elements in {len(data)} bytes")
        self.counts.append(count)
        read = self.rows.read
        for _ in range(count):
            position = read(data, position)
        return position

    def take(self, _rows: int, table: Table) -> None:
        """Add what was read to a table."""
        counts = np.array(self.counts, dtype=np.int64)
        table.children[self.path] = counts, self.rows.take(int(counts.sum()))


class Rows:
    """The parts that the rows of one table are read with, in the order of the bytes."""

    def __init__(self) -> None:
        self.parts: list[Numbers | Moments | Text | Texts | Children] = []
        self._readers: list[Callable[[bytes, int], int]] = []

    def append(self, part: "Numbers | Moments | Text | Texts | Children") -> None:
        """Read this part after the others."""
        self.parts.append(part)
        self._readers.append(part.read)

    def read(self, data: bytes, position: int) -> int:
        """Read one row from a position on; where it ends."""
        for reader in self._readers:
            position = reader(data, position)
        return position

    def take(self, rows: int) -> Table:
        """The table of so many rows that were read."""
        table = Table(rows, {}, {})
        for part in self.parts:
            part.take(rows, table)
        return table


def _length(data: bytes, position: int) -> tuple[int, int]:
    """The length that stands at a position or after the padding there, and where it ends."""
    position = (position + 3) & -4
    return _LENGTH.unpack_from(data, position)[0], position + 4


def _text(data: bytes, position: int) -> tuple[bytes, int]:
    """The text at a position, without the zero at its end, and where it ends."""
    length, position = _length(data, position)
    return data[position : position + length - 1] if length else b"", position + length


def _objects(found: list[bytes]) -> NDArray[np.object_]:
    values = np.empty((len(found), 1), dtype=object)
    values[:, 0] = found
    return values
