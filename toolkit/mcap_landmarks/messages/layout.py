"""How messages lie in CDR, from any schema in ROS 2's language."""

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from struct import error as struct_error

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import read_with
from mcap_landmarks.messages.columns import Children, Kind, Moments, Numbers, Rows, Table, Text, Texts
from mcap_landmarks.messages.definition_extent import FieldType, check_extent

_SCALARS = {
    "bool": "?", "byte": "<u1", "char": "<u1", "octet": "<u1", "int8": "<i1", "uint8": "<u1", "int16": "<i2",
    "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8", "float32": "<f4",
    "float64": "<f8",
}  # fmt: skip
_BYTES = (np.dtype("<u1"), np.dtype("<i1"))
_MOMENTS = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
LITTLE_ENDIAN, BIG_ENDIAN = b"\x00\x01", b"\x00\x00"
"""How the encapsulation of CDR begins."""
Definition = Mapping[str, list[tuple[str, FieldType]]]
_Flat = tuple[np.dtype[np.number], int, Kind]


class Layout:
    """How messages of one type lie in CDR: `definition` are the fields of all types that it needs, by their names.

    `parts` are what a message consists of, in the order of the bytes, `empty` is the table of no message, `columns` the
    names of its columns.
    `stamped` says whether each message begins with a time stamp, in its bytes 4 to 12; `has_payload` whether it
    carries bytes of some other format, as images do.

    Raises:
        MessageError: the schema cannot be understood.
    """

    def __init__(self, ros_type: str, schema: str) -> None:
        self.ros_type = ros_type
        try:
            self._types = get_types_from_msg(schema, ros_type)
            self.definition: Definition = {name: fields for name, (_, fields) in self._types.items()}
            check_extent(self.definition, ros_type)
            self.parts = tuple(self._rows().parts)
        except (TypesysError, KeyError, RecursionError, MessageError) as error:
            reason = error or type(error).__name__
            raise MessageError(f"{ros_type}: its schema cannot be understood ({reason})") from error
        self.empty = self.table([])
        self.columns = tuple(self.empty.columns)
        self.stamped = isinstance(next(iter(self.parts), None), Moments)
        self.has_payload = any(isinstance(p, Numbers) and p.dtype in _BYTES and p.count is None for p in self.parts)

    def begins(self, other: "Layout") -> bool:
        """Whether the other type has all fields of this one first, and perhaps more: as a message that has grown."""
        own, others = self.definition[self.ros_type], other.definition.get(self.ros_type, ())
        parts = {name: fields for name, fields in self.definition.items() if name != self.ros_type}
        same = all(other.definition.get(name) == fields for name, fields in parts.items())
        return same and list(others[: len(own)]) == list(own)

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

    def in_little_endian(self, data: bytes) -> bytes:
        """A message in big endian as one in little endian; every other as it is.

        Raises:
            MessageError: its bytes do not fit the schema.
        """
        if data[:2] != BIG_ENDIAN:
            return data
        store, name = self._store, self.ros_type
        return read_with(store, lambda ros: bytes(store.serialize_cdr(ros, name, little_endian=True)), name, data)

    @cached_property
    def _store(self) -> Typestore:
        store = get_typestore(Stores.EMPTY)
        store.register(self._types)
        return store

    def _rows(self) -> Rows:
        rows = Rows()
        for name, node in self.definition[self.ros_type]:
            _add(rows, self.definition, node, name)
        return rows


@lru_cache(maxsize=256)
def layout_of(ros_type: str, schema: str) -> Layout:
    """The layout of a type, made once; raises as `Layout`."""
    return Layout(ros_type, schema)


def _read(rows: Rows, data: bytes) -> None:
    if data[:2] != LITTLE_ENDIAN:
        raise MessageError(f"{len(data)} bytes are not CDR in little endian")
    left = len(data) - 4 - rows.read(data[4:], 0)
    if not 0 <= left < 4:
        raise MessageError(f"{len(data)} bytes do not fit the schema")


def _add(rows: Rows, types: Definition, node: FieldType, path: str) -> None:
    """Add a field, or all fields of a message type."""
    sort, detail = node
    if sort in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        element, count = detail
        _add_many(rows, types, element, path, count if sort == Nodetype.ARRAY else None)
    elif sort == Nodetype.BASE and detail[0] == "string":
        rows.append(Text(path))
    elif sort == Nodetype.NAME and detail in _MOMENTS:
        rows.append(Moments(path))
    elif flat := _flat(types, node):
        _add_numbers(rows, flat, path)
    else:
        for name, inner in types[detail]:
            _add(rows, types, inner, f"{path}.{name}" if path else name)


def _add_many(rows: Rows, types: Definition, element: FieldType, path: str, count: int | None) -> None:
    flat = _flat(types, element)
    if flat and count is not None:
        dtype, width, _ = flat
        _add_numbers(rows, (dtype, count * width, Kind.NUMBER), path)
    elif flat:
        dtype, width, kind = flat
        rows.append(Numbers(dtype, None, width, [(path, kind, 0, width)]))
    elif element[0] == Nodetype.BASE:
        rows.append(Texts(path, count))
    else:
        inner = Rows()
        _add(inner, types, element, "")
        rows.append(Children(path, count, inner))


def _add_numbers(rows: Rows, flat: _Flat, path: str) -> None:
    """Add numbers to the run of those of the same type that was added last, or begin one."""
    dtype, width, kind = flat
    last = rows.parts[-1] if rows.parts else None
    if not (isinstance(last, Numbers) and last.dtype == dtype and last.count is not None):
        last = Numbers(dtype, 0)
        rows.append(last)
    start = last.count or 0
    last.count = start + width
    last.fields.append((path, kind, start, last.count))


def _flat(types: Definition, node: FieldType) -> _Flat | None:
    """Scalar type, width and kind of a number or of a message of numbers of one type."""
    sort, detail = node
    if sort == Nodetype.BASE:
        return None if detail[0] == "string" else (_scalar(detail[0]), 1, Kind.NUMBER)
    if sort != Nodetype.NAME or detail in _MOMENTS:
        return None
    names = {inner[1][0] if inner[0] == Nodetype.BASE else None for _, inner in types[detail]}
    if len(names) != 1 or not names <= set(_SCALARS):
        return None
    kind = Kind.QUATERNION if detail == "geometry_msgs/msg/Quaternion" else Kind.NUMBER
    return _scalar(names.pop() or ""), len(types[detail]), kind


def _scalar(name: str) -> np.dtype[np.number]:
    if name not in _SCALARS:
        raise KeyError(f"type {name}")
    return np.dtype(_SCALARS[name])
