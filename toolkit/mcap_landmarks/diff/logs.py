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
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.header import frame_in
from mcap_landmarks.messages.layout import Layout, layout_of
from mcap_landmarks.messages.typestore import definition, typestore
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Connection, RawMessage, Tolerance

HELD_BYTES = 1 << 23
"""So much of both recordings is held before it is compared."""
PARTNER_NS = 10 * 10**9
"""How much later in log time than a message its partner may come."""
Connections = Sequence[Connection]
_STAMP = Struct("<iI")


class _Held(NamedTuple):
    key_ns: int
    camera: str
    log_time_ns: int
    data: bytes


@dataclass(slots=True)
class Topic:
    """One topic of either recording, and its messages that still wait for their partner.

    Its messages are compared by fields if both sides describe them alike, else, and where they carry images or the
    like, by their bytes. Of a type that has grown at its end between the two, the fields that both have are compared.
    `layouts` are those of both sides; `form` is their type if it is one of ours; `fields` are those of both.
    """

    ros_type: str
    layouts: tuple[Layout, Layout] | None
    form: str
    fields: frozenset[str]
    diff: ChannelDiff
    waiting: tuple[list[_Held], list[_Held]] = field(default_factory=lambda: ([], []))

    @classmethod
    def of(cls, baseline: Connections, candidate: Connections, tolerance: Callable[[str], Tolerance]) -> "Topic":
        """The topic of these connections, of one side at least."""
        connections = (*baseline, *candidate)
        ros_type, layouts = connections[0].message_type, _layouts(baseline or candidate, candidate or baseline)
        if layouts and layouts[0].has_payload:
            layouts = None
        form = ros_type if layouts and _is_ours(ros_type, layouts) else ""
        empty = [frozenset(compared(form, layout.table([])).fields.columns) for layout in layouts or ()]
        fields = frozenset.intersection(*empty) if empty else frozenset()
        return cls(ros_type, layouts, form, fields, ChannelDiff(ros_type, tolerance, unit_of(form)))

    def field_names(self) -> tuple[str, ...]:
        """The fields that are compared; those of a list's messages begin with `message.`."""
        found = self._read(0, [])
        names = tuple(found.fields.columns)
        if found.items is None:
            return names
        return (*found.items.fields.columns, *(f"message.{name}" for name in names))

    def hold(self, side: int, raw: RawMessage) -> int:
        """Keep a message until its partner comes; the bytes that this takes."""
        data, key_ns, camera = bytes(raw.data), raw.log_time_ns, ""
        if self.layouts is None:
            data = _digest(data)
        elif self.layouts[side].stamped and len(data) >= 12:
            seconds, nanoseconds = _STAMP.unpack_from(data, 4)
            key_ns = seconds * 10**9 + nanoseconds or key_ns
            camera = frame_in(data) if self.form == Detections.ROS_TYPE else ""  # several have one channel
        self.waiting[side].append(_Held(key_ns, camera, raw.log_time_ns, data))
        return len(data)

    def compare(self, until_ns: int) -> int:
        """Compare what has its partner, give up what is older than `until_ns`; the bytes that are still held."""
        mine, theirs = self.waiting
        pairs = pair_keys(*([(held.key_ns, held.camera) for held in side] for side in self.waiting))
        paired = zip(pairs.baseline.tolist(), pairs.candidate.tolist(), strict=True)
        self._compare_partners([(mine[i], theirs[j]) for i, j in paired])
        mine[:], theirs[:] = (
            [mine[row] for row in pairs.removed.tolist()],
            [theirs[row] for row in pairs.added.tolist()],
        )
        self._give_up(0, until_ns)
        self._give_up(1, until_ns)
        return sum(len(held.data) for waiting in self.waiting for held in waiting)

    def _compare_partners(self, partners: Sequence[tuple[_Held, _Held]]) -> None:
        """Compare messages that belong together; those with the same bytes are read once."""
        for sides_read, _ in self._batches(0, [mine for mine, theirs in partners if mine == theirs]):
            self.diff.equal(sides_read[0])
        others = [(mine, theirs) for mine, theirs in partners if mine != theirs]
        for sides_read, times in self._batches(0, [mine for mine, _ in others], [theirs for _, theirs in others]):
            self.diff.pair(sides_read[0], sides_read[1], times)

    def _give_up(self, side: int, until_ns: int) -> None:
        """Count messages of one side that are too old to meet a partner any more as `removed` or `added`."""
        waiting = self.waiting[side]
        for sides_read, times in self._batches(side, [held for held in waiting if held.log_time_ns < until_ns]):
            self.diff.only("added" if side else "removed", sides_read[0], times)
        waiting[:] = [held for held in waiting if held.log_time_ns >= until_ns]

    def _batches(self, first: int, *sides: Sequence[_Held]) -> Iterator[tuple[list[ComparedMessages], Rows]]:
        """Messages that belong together, side by side, and their times; those that cannot be read are seen as bytes.

        `first` is the side, 0 or 1, of those that are named first.
        """
        count = len(sides[0])
        if not count:
            return
        try:
            sides_read = [self._read(first + i, messages) for i, messages in enumerate(sides)]
        except MessageError:
            if count > 1:
                yield from self._batches(first, *(side[: count // 2] for side in sides))
                yield from self._batches(first, *(side[count // 2 :] for side in sides))
                return
            sides_read = [_content([_digest(held.data) for held in side]) for side in sides]
        yield sides_read, np.array([held.key_ns for held in sides[0]], dtype=np.int64)

    def _read(self, side: int, messages: Sequence[_Held]) -> ComparedMessages:
        if self.layouts is None:
            return _content([held.data for held in messages])
        found = compared(self.form, self.layouts[side].table([held.data for held in messages]))
        logged = np.array([held.log_time_ns for held in messages], dtype=np.int64)
        columns = {name: column for name, column in found.fields.columns.items() if name in self.fields}
        columns["log_time_ns"] = Column(Kind.TIME, logged[:, None])
        counted = tuple(name for name in found.fields.counted if name in self.fields)
        return ComparedMessages(found.rows, Fields(columns, counted), found.items)


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


def _layouts(baseline: Connections, candidate: Connections) -> tuple[Layout, Layout] | None:
    """How the messages of each side lie in their bytes; None if unknown, or if neither has grown from the other."""
    mine, theirs = shared_layout(baseline), shared_layout(candidate)
    if mine is None or theirs is None or not (mine.begins(theirs) or theirs.begins(mine)):
        return None
    return mine, theirs


def _layout(connection: Connection) -> Layout:
    if (connection.message_encoding, connection.schema_encoding) != ("cdr", "ros2msg"):
        raise MessageError(f"{connection.topic}: is not CDR described in ros2msg")
    return layout_of(connection.message_type, connection.schema.decode())


def _is_ours(ros_type: str, layouts: tuple[Layout, Layout]) -> bool:
    if ros_type not in typestore().fielddefs:
        return False
    ours = layout_of(ros_type, definition(ros_type)).definition
    return any(layout.definition == ours for layout in layouts)


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
