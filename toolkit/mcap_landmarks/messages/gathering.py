"""Columns of messages that lie in one buffer: those that are laid out alike are gathered at once, by their places."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from struct import Struct
from struct import error as struct_error
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.columns import Children, Column, Kind, Moments, Numbers, Table, Text, Texts
from mcap_landmarks.messages.gathered_rows import Gathered, Indices, in_order
from mcap_landmarks.messages.layout import LITTLE_ENDIAN, Layout

_LENGTH = Struct("<I")
_WORD, _HALF, _BYTE = np.dtype("<u4"), np.dtype("<u2"), np.dtype("u1")
_CDR_BYTES = 4
"""Of the encapsulation, which the places of all fields count from."""
_MOST_FORMS = 16
"""Messages that are laid out in yet more ways are read one by one: to find a way and gather by it takes as long as to
read some 20 messages of odometry one by one."""
_AT_ONCE = 2000
"""So many messages that are read one by one become columns together; memory stays small."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedMessages:
    """N messages in a buffer: where their bytes start, and how many there are; `step` is from each start to the next.

    It is 0 where that varies.
    """

    content: memoryview
    starts: Indices
    sizes: Indices
    step: int = 0

    def __len__(self) -> int:
        return len(self.starts)

    def at(self, rows: NDArray[Any]) -> "PlacedMessages":
        """Some of them."""
        return PlacedMessages(self.content, self.starts[rows], self.sizes[rows])

    def data(self, row: int) -> bytes:
        """The bytes of one."""
        start = int(self.starts[row])
        return bytes(self.content[start : start + int(self.sizes[row])])

    def gather(self, offset: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        """What lies in each of them (N,) at an offset: the buffer viewed at every byte, indexed, or at every step."""
        if self.step and len(self):
            return np.ndarray((len(self),), dtype, self.content, int(self.starts[0]) + offset, (self.step,))
        count = max(len(self.content) - offset - dtype.itemsize + 1, 0)
        every: NDArray[Any] = np.ndarray((count,), dtype, self.content, min(offset, len(self.content)), (1,))
        return every[self.starts]

    def gather_many(self, offset: int, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
        """So many values (N, count) in each of them from an offset on: in the buffer itself where there is a step."""
        width = count * dtype.itemsize
        if not width or not len(self):
            return np.zeros((len(self), count), dtype)
        if self.step:
            first = int(self.starts[0]) + offset
            return np.ndarray((len(self), count), dtype, self.content, first, (self.step, dtype.itemsize))
        found = np.ascontiguousarray(self.gather(offset, np.dtype(f"V{width}")))
        return found.view(dtype).reshape(len(self), count)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a part of a message lies: at an offset, so many values or, of a text, bytes."""

    part: Numbers | Moments | Text
    offset: int
    count: int


@dataclass(frozen=True, slots=True)
class Form:
    """One way in which messages of a type are laid out: their size, the lengths at some offsets, the places."""

    size: int
    lengths: tuple[tuple[int, int], ...]
    places: tuple[_Place, ...]

    def fits(self, messages: PlacedMessages) -> NDArray[np.bool_]:
        """Which messages (N,) are laid out like this: of this size, in little endian, with the same lengths inside."""
        found: NDArray[np.bool_] = messages.sizes == self.size
        if found.all():
            return self._fits(messages)
        rows = np.flatnonzero(found)
        found[rows] = self._fits(messages.at(rows))
        return found

    def _fits(self, messages: PlacedMessages) -> NDArray[np.bool_]:
        """The same of messages of this size."""
        same: NDArray[np.bool_] = messages.gather(0, _HALF) == int.from_bytes(LITTLE_ENDIAN, "little")
        for offset, length in self.lengths:
            same &= messages.gather(offset, _WORD) == length
        return same

    def table(self, messages: PlacedMessages, fields: Collection[str]) -> Table:
        """The fields of messages that are laid out like this."""
        table = Table(len(messages), {}, {})
        for place in self.places:
            if isinstance(place.part, Numbers):
                _add_numbers(table, place.part, place, messages, fields)
            elif place.part.path in fields:
                made = _times if isinstance(place.part, Moments) else _texts
                table.columns[place.part.path] = made(place, messages)
        return table


def read_placed(
    layout: Layout, messages: PlacedMessages, fields: Collection[str], known: list[Form] | None = None
) -> tuple[Table, NDArray[np.bool_]]:
    """Columns of messages by the names of their fields, and which messages (N,) could be read: others have no rows.

    What `Layout.table` gives of them in little endian, but for the elements of sequences of messages. Values may lie in
    the messages' buffer, and are of shape (N, count, k) where each row has as many: `Gathered` copies them from there.
    `known` keeps the form that messages had for the next ones.
    """
    wanted = frozenset(fields)
    known = [] if known is None else known
    parts, rest = _groups(layout, messages, wanted, known)
    if len(parts) == 1 and parts[0][1].rows == len(messages):
        return parts[0][1], np.ones(len(messages), dtype=np.bool_)
    for begin in range(0, len(rest), _AT_ONCE):
        batch = rest[begin : begin + _AT_ONCE].tolist()
        parts += _one_by_one(layout, [(row, messages.data(row)) for row in batch], wanted)
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(rows for rows, _ in parts)])
    is_read = np.zeros(len(messages), dtype=np.bool_)
    is_read[rows] = True
    gathered = Gathered(empty_table(layout, wanted), len(rows))
    for _, table in parts:
        gathered.add(table)
    return in_order(gathered.table(), np.argsort(rows)), is_read


def _groups(
    layout: Layout, messages: PlacedMessages, fields: Collection[str], known: list[Form]
) -> tuple[list[tuple[Indices, Table]], Indices]:
    """The rows and the table of each group of messages that are laid out alike, and the rows of all others."""
    rest = np.arange(len(messages), dtype=np.int64)
    found: list[tuple[Indices, Table]] = []
    for _ in range(_MOST_FORMS):
        form = known.pop() if known else None
        form = form or (_form(layout, messages.data(int(rest[0]))) if len(rest) else None)
        if form is None:
            break
        alike = messages if len(rest) == len(messages) else messages.at(rest)
        fits = form.fits(alike)
        if fits.all():
            known.append(form)
            return [*found, (rest, form.table(alike, fields))], rest[:0]
        rows, rest = rest[fits], rest[~fits]
        found.append((rows, form.table(messages.at(rows), fields)))
    return found, rest


def _one_by_one(
    layout: Layout, messages: Sequence[tuple[int, bytes]], fields: Collection[str]
) -> list[tuple[Indices, Table]]:
    """Rows and tables of messages that can be read; where one cannot, halves are tried until it stands alone."""
    if not messages:
        return []
    try:
        table = layout.table([layout.in_little_endian(data) for _, data in messages])
    except MessageError:
        half = len(messages) // 2
        return [
            found for part in (messages[:half], messages[half:]) if half for found in _one_by_one(layout, part, fields)
        ]
    return [(np.array([row for row, _ in messages], dtype=np.int64), _some(table, fields))]


def empty_table(layout: Layout, fields: Collection[str] | None = None) -> Table:
    """No rows of some columns, by default all.

    Raises:
        MessageError: the type has no such field.
    """
    wanted = layout.columns if fields is None else tuple(fields)
    if unknown := [name for name in wanted if name not in layout.columns]:
        raise MessageError(f"{layout.ros_type} has no field {unknown[0]!r} that makes a column")
    return _some(layout.empty, wanted)


def _some(table: Table, fields: Collection[str]) -> Table:
    return Table(table.rows, {name: column for name, column in table.columns.items() if name in fields}, {})


def _form(layout: Layout, data: bytes) -> Form | None:
    """How a message is laid out; None if it does not fit its type, or has elements that are found one by one only."""
    places, lengths, position = list[_Place](), list[tuple[int, int]](), 0
    if data[:2] != LITTLE_ENDIAN:
        return None
    try:
        for part in layout.parts:
            if isinstance(part, Texts | Children):
                return None
            count = part.count if isinstance(part, Numbers) else 8 if isinstance(part, Moments) else None
            if count is None:
                position = (position + 3) & -4
                count = _LENGTH.unpack_from(data, _CDR_BYTES + position)[0]
                lengths.append((_CDR_BYTES + position, count))
                position += 4
            position, end = _span(part, position, count)
            places.append(_Place(part, _CDR_BYTES + position, count))
            position = end
    except struct_error:
        return None
    left = len(data) - _CDR_BYTES - position
    return Form(len(data), tuple(lengths), tuple(places)) if 0 <= left < 4 else None


def _span(part: Numbers | Moments | Text, position: int, count: int) -> tuple[int, int]:
    """Where so many values of a part lie that come next."""
    if isinstance(part, Text):
        return position, position + count
    if isinstance(part, Moments):
        position = (position + 3) & -4
        return position, position + count
    size = part.dtype.itemsize
    if part.count is None and not count:  # nothing follows, not even padding
        return position, position
    position = (position + size - 1) & -size
    return position, position + count * size * (part.width if part.count is None else 1)


def _add_numbers(table: Table, part: Numbers, place: _Place, messages: PlacedMessages, fields: Collection[str]) -> None:
    for path, kind, start, stop in part.fields:
        if path not in fields:
            continue
        counts, offset, width = None, place.offset + start * part.dtype.itemsize, stop - start
        if part.count is None:
            counts, width = np.full(len(messages), place.count, dtype=np.int64), place.count * part.width
        values = messages.gather_many(offset, part.dtype, width)
        values = values.view(np.uint8) if part.dtype == np.bool_ else values
        if counts is not None:
            values = values.reshape(len(messages), place.count, part.width)
        table.columns[path] = Column(kind, values, counts)


def _times(place: _Place, messages: PlacedMessages) -> Column:
    words = messages.gather_many(place.offset, _WORD, 2)
    time_ns = words[:, 0].view("<i4").astype(np.int64) * 10**9 + words[:, 1]
    return Column(Kind.TIME, time_ns[:, None])


def _texts(place: _Place, messages: PlacedMessages) -> Column:
    """Texts of one length: most often they are all the same one, which is then one object."""
    found = messages.gather_many(place.offset, _BYTE, max(place.count - 1, 0))  # without the zero at their end
    values = np.empty((len(messages), 1), dtype=object)
    if not len(found) or (found == found[0]).all():
        values[:] = found[0].tobytes() if len(found) else b""
    else:
        values[:, 0] = [row.tobytes() for row in found]
    return Column(Kind.TEXT, values)
