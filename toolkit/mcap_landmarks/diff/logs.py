"""Compare the messages of two recordings, channel by channel, in one pass over both and in bounded memory."""

import hashlib
import heapq
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from struct import Struct
from typing import NamedTuple

import numpy as np

from mcap_landmarks.diff.channel import ChannelDiff
from mcap_landmarks.diff.fields import ComparedMessages, Fields, compared, unit_of
from mcap_landmarks.diff.pairs import pair_keys
from mcap_landmarks.diff.values import Rows
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.columns import Column, Kind
from mcap_landmarks.messages.layout import Layout, layout_of
from mcap_landmarks.messages.typestore import definition, typestore
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Connection, Progress, RawMessage, Tolerance

HELD_BYTES = 1 << 23
"""So much of both recordings is held before it is compared."""
PARTNER_NS = 10 * 10**9
"""How much later in log time than a message its partner may come."""
Connections = Sequence[Connection]
_STAMP = Struct("<iI")


class _Held(NamedTuple):
    key_ns: int
    log_time_ns: int
    data: bytes


@dataclass(slots=True)
class Topic:
    """One topic of either recording, and its messages that still wait for their partner.

    Its messages are compared by fields if both sides describe them alike, else, and where they carry images or the
    like, by their bytes. `form` is their type if it is one of ours.
    """

    ros_type: str
    layout: Layout | None
    form: str
    diff: ChannelDiff
    waiting: tuple[list[_Held], list[_Held]] = field(default_factory=lambda: ([], []))

    @classmethod
    def of(cls, baseline: Connections, candidate: Connections, tolerance: Callable[[str], Tolerance]) -> "Topic":
        """The topic of these connections, of one side at least."""
        connections = (*baseline, *candidate)
        ros_type, layout = connections[0].message_type, shared_layout(connections)
        form = ros_type if layout and _is_ours(ros_type, layout) else ""
        if layout and layout.has_payload:
            layout, form = None, ""
        return cls(ros_type, layout, form, ChannelDiff(ros_type, tolerance, unit_of(form)))

    def field_names(self) -> tuple[str, ...]:
        """The fields that are compared; those of a list's messages begin with `message.`."""
        found = self._read([])
        names = tuple(found.fields.columns)
        if found.items is None:
            return names
        return (*found.items.fields.columns, *(f"message.{name}" for name in names))

    def hold(self, side: int, raw: RawMessage) -> int:
        """Keep a message until its partner comes; the bytes that this takes."""
        data, key_ns = bytes(raw.data), raw.log_time_ns
        if self.layout is None:
            data = _digest(data)
        elif self.layout.stamped and len(data) >= 12:
            seconds, nanoseconds = _STAMP.unpack_from(data, 4)
            key_ns = seconds * 10**9 + nanoseconds or key_ns
        self.waiting[side].append(_Held(key_ns, raw.log_time_ns, data))
        return len(data)

    def compare(self, until_ns: int) -> int:
        """Compare what has its partner, give up what is older than `until_ns`; the bytes that are still held."""
        mine, theirs = self.waiting
        pairs = pair_keys([held.key_ns for held in mine], [held.key_ns for held in theirs])
        paired = zip(pairs.baseline.tolist(), pairs.candidate.tolist(), strict=True)
        self._compare_partners([(mine[i], theirs[j]) for i, j in paired])
        mine[:], theirs[:] = (
            [mine[row] for row in pairs.removed.tolist()],
            [theirs[row] for row in pairs.added.tolist()],
        )
        self._give_up("removed", mine, until_ns)
        self._give_up("added", theirs, until_ns)
        return sum(len(held.data) for waiting in self.waiting for held in waiting)

    def _compare_partners(self, partners: Sequence[tuple[_Held, _Held]]) -> None:
        """Compare messages that belong together; those with the same bytes are read once."""
        for sides_read, _ in self._batches([mine for mine, theirs in partners if mine == theirs]):
            self.diff.equal(sides_read[0])
        others = [(mine, theirs) for mine, theirs in partners if mine != theirs]
        for sides_read, times in self._batches([mine for mine, _ in others], [theirs for _, theirs in others]):
            self.diff.pair(sides_read[0], sides_read[1], times)

    def _give_up(self, side: str, waiting: list[_Held], until_ns: int) -> None:
        """Count messages that are too old to meet a partner any more as `removed` or `added`."""
        for sides_read, times in self._batches([held for held in waiting if held.log_time_ns < until_ns]):
            self.diff.only(side, sides_read[0], times)
        waiting[:] = [held for held in waiting if held.log_time_ns >= until_ns]

    def _batches(self, *sides: Sequence[_Held]) -> Iterator[tuple[list[ComparedMessages], Rows]]:
        """Messages that belong together, side by side, and their times; those that cannot be read are seen as bytes."""
        count = len(sides[0])
        if not count:
            return
        try:
            sides_read = [self._read(side) for side in sides]
        except MessageError:
            if count > 1:
                yield from self._batches(*(side[: count // 2] for side in sides))
                yield from self._batches(*(side[count // 2 :] for side in sides))
                return
            sides_read = [_content([_digest(held.data) for held in side]) for side in sides]
        yield sides_read, np.array([held.key_ns for held in sides[0]], dtype=np.int64)

    def _read(self, messages: Sequence[_Held]) -> ComparedMessages:
        if self.layout is None:
            return _content([held.data for held in messages])
        found = compared(self.form, self.layout.table([held.data for held in messages]))
        logged = np.array([held.log_time_ns for held in messages], dtype=np.int64)
        columns = {**found.fields.columns, "log_time_ns": Column(Kind.TIME, logged[:, None])}
        return ComparedMessages(found.rows, Fields(columns, found.fields.counted), found.items)


def compare_messages(
    baseline: Recording, candidate: Recording, topics: dict[str, Topic], progress: Progress | None = None
) -> None:
    """Compare all messages of the topics."""
    streams = (_side(recording, number, topics, progress) for number, recording in enumerate((baseline, candidate)))
    held = 0
    for side, raw in heapq.merge(*streams, key=lambda entry: entry[1].log_time_ns):
        held += topics[raw.connection.topic].hold(side, raw)
        if held > HELD_BYTES:
            held = sum(topic.compare(raw.log_time_ns - PARTNER_NS) for topic in topics.values())
    for topic in topics.values():
        topic.compare(2**64)


def shared_layout(connections: Collection[Connection]) -> Layout | None:
    """How the messages of all these connections lie in their bytes; None if that differs or is unknown."""
    try:
        layouts = [_layout(connection) for connection in connections]
    except (MessageError, UnicodeDecodeError):
        return None
    first = layouts[0]
    return first if all(layout.definition == first.definition for layout in layouts) else None


def _layout(connection: Connection) -> Layout:
    if (connection.message_encoding, connection.schema_encoding) != ("cdr", "ros2msg"):
        raise MessageError(f"{connection.topic}: is not CDR described in ros2msg")
    return layout_of(connection.message_type, connection.schema.decode())


def _is_ours(ros_type: str, layout: Layout) -> bool:
    known = ros_type in typestore().fielddefs
    return known and layout.definition == layout_of(ros_type, definition(ros_type)).definition


def _side(
    recording: Recording, number: int, topics: Collection[str], progress: Progress | None
) -> Iterator[tuple[int, RawMessage]]:
    wanted = [entry.connection for entry in recording.channels if entry.connection.topic in topics]
    return ((number, raw) for raw in recording.messages(wanted, progress=progress))


def _digest(data: bytes) -> bytes:
    return f"{len(data)} bytes, {hashlib.blake2b(data, digest_size=16).hexdigest()}".encode()


def _content(digests: Sequence[bytes]) -> ComparedMessages:
    """Messages of which only their bytes are compared."""
    values = np.empty((len(digests), 1), dtype=object)
    values[:, 0] = digests
    return ComparedMessages(len(digests), Fields({"content": Column(Kind.TEXT, values)}))
