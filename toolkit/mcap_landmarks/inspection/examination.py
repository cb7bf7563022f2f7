"""What a log's stamps, transforms and odometry are worth: found before the log is used, once for all its readers."""

from array import array
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mcap_landmarks.channels import (
    CLUSTERED_CLOUD,
    DETECTIONS,
    ODOMETRY,
    SCAN,
    SCAN_OBJECTS,
    SCENE_OBJECTS,
    SCENE_VELOCITIES,
    SECOND_SCAN,
)
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.log_frames import LogFrames, frames_of, told_circle
from mcap_landmarks.inspection.odometry_examination import ExaminedOdometry, OdometryMessages, examine
from mcap_landmarks.inspection.topic_roles import message_type
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.header import frame_in, stamp_in
from mcap_landmarks.moments import LATEST_NS
from mcap_landmarks.mounting import BASES, Edge, base_in
from mcap_landmarks.recording.clocks import Clock, Times, clock_of, shifts_of
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.stage import Channel, Connection, RawMessage, Readable

_TIMED = (SCAN, SECOND_SCAN, DETECTIONS, SCENE_OBJECTS)
"""Channels that meet others by their stamps, beside odometry; what is held, or an image alone, does not."""
_MADE = (SCAN_OBJECTS, CLUSTERED_CLOUD, SCENE_OBJECTS, SCENE_VELOCITIES)
"""Results that have the stamps of what they were made from, also where its clock was set back."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What is to be examined: the connections that are read, as which channels, and which one makes the bundles.

    `made` are those of results, whose stamps and frames are right already; `offsets_ns` are added to stamps.
    """

    inputs: Mapping[Connection, Channel[Message]]
    primary: Connection
    made: Collection[Connection] = ()
    offsets_ns: Mapping[Connection, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Examined:
    """What is known of a log before its messages are associated: where its frames are, which one is the robot's own.

    `clocks` are those of the connections whose messages meet by their stamps, `foreign` the frames that few of a
    connection's messages are in, and that are not its own.
    """

    frames: LogFrames
    base: str
    clocks: Mapping[Connection, Clock] = field(default_factory=dict)
    foreign: Mapping[Connection, frozenset[str]] = field(default_factory=dict)
    odometry: ExaminedOdometry | None = None


class Examiner:
    """Examines logs of one recording over one time span, and remembers; `own` are a file's transforms."""

    def __init__(self, start_ns: int | None = None, end_ns: int | None = None, own: Collection[Edge] = ()) -> None:
        self._span, self._own = (start_ns, end_ns), tuple(own)
        self._frames: LogFrames | None = None
        self._times: dict[Connection, tuple[array[int], array[int]]] = {}
        self._named: dict[Connection, Counter[str]] = {}
        self._messages: dict[frozenset[Connection], OdometryMessages] = {}
        self._odometry: dict[object, ExaminedOdometry] = {}

    def examine(self, log: Readable, asked: Asked) -> Examined:
        """What is to be known before the inputs of a stage are associated.

        Raises:
            RecordingError: transforms go round in a circle.
        """
        if self._frames is None:
            self._frames = frames_of(log, self._own)
        if circle := self._frames.circle:
            raise RecordingError(f"{log.path}: {told_circle(circle)}")
        odometry = frozenset(entry for entry, channel in asked.inputs.items() if channel == ODOMETRY)
        timed = _raw(asked)
        self._read(log, odometry, timed)
        base = self._base(log, asked, odometry)
        shifts_ns, first_ns = self._shifts(asked, odometry)
        if len(shifts_ns) > 1:
            timed += (made := _stamped_as_made(asked))
            self._read(log, odometry, made)
        clocks = {
            entry: replace(
                clock_of(*_columns(self._times[entry]), shifts_ns, first_ns), offset_ns=asked.offsets_ns.get(entry, 0)
            )
            for entry in timed
        }
        foreign = {entry: self._frames.foreign(base, self._named[entry]) for entry in timed}
        return Examined(
            self._frames, base, clocks, foreign, self._examined(asked, odometry, base, (shifts_ns, first_ns))
        )

    def _read(self, log: Readable, odometry: frozenset[Connection], timed: Collection[Connection]) -> None:
        """Read stamps and odometry that are not known yet, in one pass."""
        new = [entry for entry in timed if entry not in self._times]
        is_new = bool(odometry) and odometry not in self._messages
        if is_new:
            self._messages[odometry] = OdometryMessages()
        self._times.update({entry: (array("q"), array("q")) for entry in new})
        self._named.update({entry: Counter() for entry in new})
        wanted = {*new, *(odometry if is_new else ())}
        for raw in log.messages(wanted, *self._span) if wanted else ():
            try:
                self._take(raw, odometry)
            except MessageError:
                continue  # whoever uses it counts it

    def _take(self, raw: RawMessage, odometry: frozenset[Connection]) -> None:
        if raw.connection not in odometry:
            log_ns, stamp_ns = self._times[raw.connection]
            stamp_ns.append(stamp_in(raw.data))
            log_ns.append(min(raw.log_time_ns, LATEST_NS))
            self._named[raw.connection][plain(frame_in(raw.data))] += 1
            return
        message = odometry_from(decode(message_type(ODOMETRY, raw.connection), raw.data))
        if message is not None:
            self._messages[odometry].take(raw.log_time_ns, message)

    def _base(self, log: Readable, asked: Asked, odometry: frozenset[Connection]) -> str:
        """The robot's own frame: that of results, what transforms say, else what odometry is of."""
        assert self._frames is not None  # noqa: S101 - `examine` finds them first
        usual = self._named.get(asked.primary, Counter()).most_common(1)
        first = None if usual else next(iter(log.messages([asked.primary], *self._span)), None)
        frame = usual[0][0] if usual else "" if first is None else plain(frame_in(first.data))
        if asked.primary in asked.made and asked.inputs[asked.primary] != DETECTIONS:
            return frame
        base = base_in(self._frames.tree, frame)
        if base in BASES or base != frame or not odometry:
            return base
        children = self._messages[odometry].frames
        return next((child for _, child in children[:1] if child), base)

    def _shifts(self, asked: Asked, odometry: frozenset[Connection]) -> tuple[tuple[int, ...], int | None]:
        """How far the log's clock was set back by and by, from 0 on, and the log time of the first time."""
        if odometry:
            return shifts_of(*self._messages[odometry].times)
        return shifts_of(*_columns(self._times[asked.primary])) if asked.primary in self._times else ((0,), None)

    def _examined(
        self, asked: Asked, odometry: frozenset[Connection], base: str, shifts: tuple[tuple[int, ...], int | None]
    ) -> ExaminedOdometry | None:
        if not odometry:
            return None
        topic, messages = min(entry.topic for entry in odometry), self._messages[odometry]
        offset_ns = max((asked.offsets_ns.get(entry, 0) for entry in odometry), key=abs)
        key = odometry, base, offset_ns, shifts
        if key not in self._odometry:
            clock = clock_of(*messages.times, *shifts)
            frames = self._frames
            assert frames is not None  # noqa: S101 - `examine` finds them first
            self._odometry[key] = examine(
                topic,
                messages,
                replace(clock, offset_ns=offset_ns),
                lambda frame: frames.base_from(base, frame, f"odometry on {topic} is"),
            )
        return self._odometry[key]


def _raw(asked: Asked) -> list[Connection]:
    """The connections whose messages meet others by stamps of drivers."""
    timed = [entry for entry, channel in asked.inputs.items() if channel in _TIMED]
    return [entry for entry in timed if asked.inputs[entry] == DETECTIONS or entry not in asked.made]


def _stamped_as_made(asked: Asked) -> list[Connection]:
    """The connections of results that have their sources' stamps."""
    return [entry for entry, channel in asked.inputs.items() if channel in _MADE and entry in asked.made]


def _columns(times: "tuple[array[int], array[int]]") -> tuple[Times, Times]:
    log_ns, stamp_ns = times
    return np.array(log_ns, dtype=np.int64), np.array(stamp_ns, dtype=np.int64)
