"""Many CDR messages of one type as columns, from any schema in ROS 2's language: no object per message."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import lru_cache
from struct import Struct
from struct import error as struct_error
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

from toolkit.errors import MessageError

_LENGTH = Struct("<I")
_SCALARS = {
    "bool": "<u1", "byte": "<u1", "char": "<u1", "octet": "<u1", "int8": "<i1", "uint8": "<u1", "int16": "<i2",
    "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8", "float32": "<f4",
    "float64": "<f8",
}  # fmt: skip
_MOMENTS = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
_MOMENT = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])
_LITTLE_ENDIAN = b"\x00\x01"


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


class Layout:
    """How messages of one type lie in CDR: `definition` are the fields of all types that it needs, by their names.

    `stamped` says whether each message begins with a time stamp, in its bytes 4 to 12; `has_payload` whether it
    carries bytes of some other format, as images do.

    Raises:
        MessageError: the schema cannot be understood.
    """

    def __init__(self, ros_type: str, schema: str) -> None:
        self._type = ros_type
        try:
            types = get_types_from_msg(schema, ros_type)
            self.definition: Mapping[str, Any] = {name: fields for name, (_, fields) in types.items()}
            parts = self._rows().parts
        except (TypesysError, KeyError, RecursionError) as error:
            reason = error or type(error).__name__
            raise MessageError(f"{ros_type}: its schema cannot be understood ({reason})") from error
        self.stamped = isinstance(next(iter(parts), None), _Moments)
        self.has_payload = any(isinstance(p, _Numbers) and p.dtype.itemsize == 1 and p.count is None for p in parts)

    def table(self, messages: Sequence[bytes]) -> Table:
        """The columns of messages.

        Raises:
            MessageError: the bytes of one do not fit the schema.
        """
        rows = self._rows()
        try:
            for data in messages:
                _read(rows, data)
        except struct_error as error:
            raise MessageError("a message is cut") from error
        return rows.take(len(messages))

    def _rows(self) -> "_Rows":
        rows = _Rows(self.definition)
        for name, node in self.definition[self._type]:
            rows.add(node, name)
        return rows


@lru_cache(maxsize=256)
def layout_of(ros_type: str, schema: str) -> Layout:
    """The layout of a type, made once; raises as `Layout`."""
    return Layout(ros_type, schema)


def _read(rows: "_Rows", data: bytes) -> None:
    if data[:2] != _LITTLE_ENDIAN:
        raise MessageError(f"{len(data)} bytes are not CDR in little endian")
    left = len(data) - 4 - rows.read(data[4:], 0)
    if not 0 <= left < 4:
        raise MessageError(f"{len(data)} bytes do not fit the schema")


@dataclass(slots=True)
class _Numbers:
    """Numbers of one scalar type: `count` a row, in several fields, or (None) as many as the row says."""

    dtype: np.dtype[Any]
    count: int | None
    width: int = 1
    fields: list[tuple[str, Kind, int, int]] = field(default_factory=list)
    slices: list[bytes] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        count = self.count
        if count is None:
            position = (position + 3) & -4
            (count,) = _LENGTH.unpack_from(data, position)
            position += 4
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
        values = np.frombuffer(b"".join(self.slices), self.dtype)
        if self.count is None:
            counts = np.array(self.counts, dtype=np.int64)
            ((path, kind, _, _),) = self.fields
            table.columns[path] = Column(kind, values.reshape(-1, self.width), counts)
            return
        values = values.reshape(rows, self.count)
        for path, kind, start, stop in self.fields:
            table.columns[path] = Column(kind, values[:, start:stop])


@dataclass(slots=True)
class _Moments:
    """A time or duration."""

    path: str
    slices: list[bytes] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        position = (position + 3) & -4
        self.slices.append(data[position : position + 8])
        return position + 8

    def take(self, rows: int, table: Table) -> None:
        pairs = np.frombuffer(b"".join(self.slices), _MOMENT)
        time_ns = pairs["sec"].astype(np.int64) * 10**9 + pairs["nanosec"]
        table.columns[self.path] = Column(Kind.TIME, time_ns.reshape(rows, 1))


@dataclass(slots=True)
class _Texts:
    """Texts: one a row, `count` a row, or (None) as many as the row says."""

    path: str
    count: int | None
    single: bool = True
    found: list[bytes] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        count = self.count
        if count is None:
            position = (position + 3) & -4
            (count,) = _LENGTH.unpack_from(data, position)
            position += 4
        if not self.single:
            self.counts.append(count)
        for _ in range(count):
            position = (position + 3) & -4
            (length,) = _LENGTH.unpack_from(data, position)
            position += 4 + length
            self.found.append(data[position - length : position - 1] if length else b"")
        return position

    def take(self, _rows: int, table: Table) -> None:
        values = np.empty((len(self.found), 1), dtype=object)
        values[:, 0] = self.found
        counts = None if self.single else np.array(self.counts, dtype=np.int64)
        table.columns[self.path] = Column(Kind.TEXT, values, counts)


@dataclass(slots=True)
class _Children:
    """Messages within a message: `count` a row, or (None) as many as the row says."""

    path: str
    count: int | None
    rows: "_Rows"
    counts: list[int] = field(default_factory=list)

    def read(self, data: bytes, position: int) -> int:
        count = self.count
        if count is None:
            position = (position + 3) & -4
            (count,) = _LENGTH.unpack_from(data, position)
            position += 4
        if count > len(data):  # every element takes a byte at least
            raise MessageError(f"{self.path} claims {count} elements in {len(data)} bytes")
        self.counts.append(count)
        read = self.rows.read
        for _ in range(count):
            position = read(data, position)
        return position

    def take(self, _rows: int, table: Table) -> None:
        counts = np.array(self.counts, dtype=np.int64)
        table.children[self.path] = counts, self.rows.take(int(counts.sum()))


class _Rows:
    """The parts that the rows of one table are read with, in the order of the bytes."""

    def __init__(self, types: Mapping[str, Any]) -> None:
        self.parts: list[_Numbers | _Moments | _Texts | _Children] = []
        self._types = types
        self._readers: list[Callable[[bytes, int], int]] = []

    def read(self, data: bytes, position: int) -> int:
        for reader in self._readers:
            position = reader(data, position)
        return position

    def take(self, rows: int) -> Table:
        table = Table(rows, {}, {})
        for part in self.parts:
            part.take(rows, table)
        return table

    def add(self, node: Any, path: str) -> None:
        """Add a field, or all fields of a message type."""
        sort, detail = node
        if sort in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
            element, count = detail
            self._add_many(element, path, count if sort == Nodetype.ARRAY else None)
        elif sort == Nodetype.BASE and detail[0] == "string":
            self._append(_Texts(path, 1))
        elif sort == Nodetype.NAME and detail in _MOMENTS:
            self._append(_Moments(path))
        elif flat := self._flat(node):
            self._add_numbers(*flat, path)
        else:
            for name, inner in self._types[detail]:
                self.add(inner, f"{path}.{name}" if path else name)

    def _add_many(self, element: Any, path: str, count: int | None) -> None:
        flat = self._flat(element)
        if flat and count is not None:
            dtype, width, _ = flat
            self._add_numbers(dtype, count * width, Kind.NUMBER, path)
        elif flat:
            dtype, width, kind = flat
            self._append(_Numbers(dtype, None, width, [(path, kind, 0, width)]))
        elif element[0] == Nodetype.BASE and element[1][0] == "string":
            self._append(_Texts(path, count, single=False))
        else:
            rows = _Rows(self._types)
            rows.add(element, "")
            self._append(_Children(path, count, rows))

    def _add_numbers(self, dtype: np.dtype[Any], width: int, kind: Kind, path: str) -> None:
        last = self.parts[-1] if self.parts else None
        if not (isinstance(last, _Numbers) and last.dtype == dtype and last.count is not None):
            last = _Numbers(dtype, 0)
            self._append(last)
        start = last.count or 0
        last.count = start + width
        last.fields.append((path, kind, start, last.count))

    def _flat(self, node: Any) -> tuple[np.dtype[Any], int, Kind] | None:
        """Scalar type, width and kind of a number or of a message of numbers of one type."""
        sort, detail = node
        if sort == Nodetype.BASE:
            scalar = _SCALARS.get(detail[0])
            if scalar is None and detail[0] != "string":
                raise KeyError(f"type {detail[0]}")
            return (np.dtype(scalar), 1, Kind.NUMBER) if scalar else None
        if sort != Nodetype.NAME or detail in _MOMENTS:
            return None
        names = {inner[1][0] if inner[0] == Nodetype.BASE else None for _, inner in self._types[detail]}
        if len(names) != 1 or not names <= set(_SCALARS):
            return None
        kind = Kind.QUATERNION if detail == "geometry_msgs/msg/Quaternion" else Kind.NUMBER
        return np.dtype(_SCALARS[names.pop() or ""]), len(self._types[detail]), kind

    def _append(self, part: "_Numbers | _Moments | _Texts | _Children") -> None:
        self.parts.append(part)
        self._readers.append(part.read)
