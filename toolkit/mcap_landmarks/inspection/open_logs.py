"""Logs of any format: bags and data sets through their sources, MCAP files through the recording reader."""

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.config import Settings, stage_config
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import RecordingWriter
from mcap_landmarks.sources import (
    BagDescription,
    Carried,
    Log,
    McapFile,
    OmittedTopic,
    Payload,
    SourceLog,
    defined,
    recorded_metadata,
    settled,
    source_of,
)
from mcap_landmarks.stage import ChannelSummary, Config, Connection, RawMessage


@dataclass(frozen=True, slots=True)
class OpenLog:
    """One log: where it comes from, its parts, and what is known of them before they are read."""

    path: Path
    name: str
    source: str
    config: Config
    parts: tuple[Log, ...]
    size_bytes: int
    losses: tuple[str, ...]
    notes: tuple[str, ...]
    dropped: Mapping[str, int] = field(default_factory=dict)
    told: tuple[tuple[str, BagDescription], ...] = ()

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`, of all parts."""
        for part in self.parts:
            part.verify(wanted)

    @property
    def left_out(self) -> list[OmittedTopic]:
        """The topics of all parts that cannot be carried."""
        return [one for part in self.parts for one in part.left_out]

    def only_file(self) -> "McapLog | None":
        """The MCAP file that the whole log is, None where it is a folder or of another format."""
        found = [part for part in self.parts if not isinstance(part, MountLog)]
        first = found[0] if len(found) == 1 and self.path.is_file() else None
        return first if isinstance(first, McapLog) else None

    def all_notes(self) -> tuple[str, ...]:
        """What is odd about the log or a part of it and costs nothing."""
        return (*self.notes, *(note for part in self.parts for note in notes_of(part)))

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        return min((part.start_ns for part in self.parts if part.start_ns is not None), default=None)

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""
        return max((part.end_ns for part in self.parts if part.end_ns is not None), default=None)


@contextlib.contextmanager
def open_logs(place: Location, settings: Settings) -> Iterator[Sequence[OpenLog]]:
    """The logs at a place, each with all its parts.

    Raises:
        RecordingError: no source knows it, or it cannot be read.
        UsageError: it is not on this machine, or a setting of its source is wrong.
    """
    path = to_read(place)
    source = source_of(path)
    config = stage_config(source.config, source.name, settings.get(source.name, {}))
    with source.open(path, config) as found:
        yield [_opened(path, source.name, config, log) for log in found]


def _opened(path: Path, source: str, config: Config, log: SourceLog) -> OpenLog:
    """A log with all its parts that can be opened.

    Raises:
        RecordingError: there is none.
    """
    parts: list[Log] = []
    problems: list[RecordingError] = []
    for part in log.parts:
        try:
            parts.append(McapLog(part) if isinstance(part, McapFile) else part)
        except RecordingError as error:
            problems.append(error)
    if problems and not parts:
        raise RecordingError("; ".join([*log.losses, *map(str, problems)]))
    recordings = [part for part in parts if isinstance(part, McapLog)]
    losses, held = (*log.losses, *map(str, problems)), sum(map(_messages_in, parts))
    notes = (*log.notes, *_told_counts(path, None if losses else log.messages, held))
    told = (*log.told, *(recording.about for recording in recordings))
    parts += [mount for recording in recordings for mount in recording.mounts()]
    return OpenLog(path, log.name, source, config, tuple(parts), log.size_bytes, losses, notes, log.dropped, told)


def _told_counts(path: Path, told: int | None, held: int) -> Iterator[str]:
    if told not in (None, held):
        yield f"{path}: its metadata count {told} messages, its files hold {held}; these were taken"


def _messages_in(part: Log) -> int:
    if isinstance(part, McapLog):
        return sum(entry.count for entry in part.recorded)
    return sum(entry.count for entry in part.channels) + sum(one.messages for one in part.left_out)


def notes_of(part: Log) -> list[str]:
    """What is odd about a part and costs nothing."""
    return part.notes if isinstance(part, McapLog) else []


class McapLog:
    """An MCAP file as part of a log. It is opened anew for each reading: a bag may have thousands of them.

    Messages of ROS 1 and of Foxglove's types become CDR, others are as they are. `recorded` are the channels as they
    lie in the file, `index` says where.
    """

    def __init__(self, file: McapFile) -> None:
        self._file = file
        with open_recording(file.path) as recording:
            self.index = recording.index
            self.profile, self.metadata = recording.profile, recording.metadata
            self.start_ns, self.end_ns = recording.start_ns, recording.end_ns
            self.losses = [f"{file.path.name}: {loss}" for loss in recording.losses]
            self.notes = [f"{file.path.name}: {note}" for note in recording.notes]
            self.recorded = tuple(recording.channels)
        self.about = (file.path.name, recorded_metadata(self.metadata))
        self.left_out: list[OmittedTopic] = []
        self._carried = [self._carry(entry) for entry in self.recorded]

    @property
    def channels(self) -> list[ChannelSummary]:
        """See `Log`."""
        pairs = zip(self._carried, self.recorded, strict=True)
        return [ChannelSummary(carried.connection, entry.count) for carried, entry in pairs if carried]

    def mounts(self) -> list["MountLog"]:
        """Where sensors are, of which only their messages tell."""
        found = []
        with open_recording(self._file.path, known=self.index) as recording:
            for entry, carried in zip(recording.channels, self._carried, strict=True):
                mount = carried.mount if carried else None
                first = next(recording.messages([entry.connection]), None) if mount else None
                if first is None or mount is None:
                    continue
                with contextlib.suppress(MessageError):  # which is told where it is read
                    transforms = mount(first.data)
                    if transforms is not None:
                        found.append(MountLog(first.log_time_ns, transforms))
        return found

    def _carry(self, entry: ChannelSummary) -> Carried | None:
        try:
            return self._file.carry(entry.connection, self.metadata)
        except MessageError as error:
            self._leave_out(entry, str(error))
            return None

    def _leave_out(self, entry: ChannelSummary, reason: str) -> None:
        if entry.count:
            about = entry.connection
            self.left_out.append(OmittedTopic(about.topic, about.message_type, entry.count, reason))

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`."""
        unsure = {
            i: carried.definitions
            for i, carried in enumerate(self._carried)
            if carried and carried.definitions and wanted(carried.connection.topic)
        }
        for i, found in settled(unsure, self._payloads).items():
            carried = self._carried[i]
            if carried is None or isinstance(found, str):
                self._carried[i] = None
                self._leave_out(self.recorded[i], str(found))
            else:
                self._carried[i] = Carried(defined(carried.connection, found), carried.convert)

    def _payloads(self, keys: Collection[int]) -> Iterator[tuple[int, Payload]]:
        """The messages of some channels; those that cannot be decompressed are told when they are read."""
        with open_recording(self._file.path) as recording:
            place = {entry.connection: i for i, entry in enumerate(recording.channels) if i in keys}
            for raw in recording.messages(list(place)):
                carried = self._carried[place[raw.connection]]
                with contextlib.suppress(MessageError):
                    yield place[raw.connection], carried.convert(raw.data) if carried else raw.data

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`."""
        with open_recording(self._file.path, known=self.index) as recording:
            wanted = {
                entry.connection: carried
                for entry, carried in zip(recording.channels, self._carried, strict=True)
                if carried and (connections is None or carried.connection in connections)
            }
            for raw in recording.messages(list(wanted), start_ns, end_ns, progress):
                connection = wanted[raw.connection].connection
                try:
                    data = wanted[raw.connection].convert(raw.data)
                except MessageError as error:
                    self._lose(f"{connection.topic}: {error}; such messages are left out")
                    continue
                yield RawMessage(connection, raw.log_time_ns, raw.publish_time_ns, raw.sequence, data)
            for loss in recording.losses:
                self._lose(loss)

    def check_attachments(self) -> None:
        """Read the file's attachments, to know of those that are damaged."""
        with open_recording(self._file.path, known=self.index) as recording:
            for _ in recording.attachments():
                pass
            for loss in recording.losses:
                self._lose(loss)

    def copy_attachments(self, writer: RecordingWriter) -> None:
        """Carry the file's attachments over."""
        with open_recording(self._file.path, known=self.index) as recording:
            for attachment in recording.attachments():
                writer.attach(attachment)
            for loss in recording.losses:
                self._lose(loss)

    def _lose(self, loss: str) -> None:
        loss = f"{self._file.path.name}: {loss}"
        if loss not in self.losses:
            self.losses.append(loss)


class MountLog:
    """One TFMessage, as part of a log that tells where a sensor is in the sensor's messages."""

    def __init__(self, log_time_ns: int, transforms: bytes) -> None:
        self.start_ns = self.end_ns = log_time_ns
        self.losses: tuple[str, ...] = ()
        self.left_out: tuple[OmittedTopic, ...] = ()
        metadata = {KEY: qos_profile(latched=True)}
        ros_type = TFMessage.ROS_TYPE
        self._connection = Connection(TF_STATIC.topic, ros_type, definition(ros_type).encode(), metadata=metadata)
        self.channels = (ChannelSummary(self._connection, 1),)
        self._raw = RawMessage(self._connection, log_time_ns, log_time_ns, 0, transforms)

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`; the definition is ours."""

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`."""
        del progress
        is_within = (start_ns or 0) <= self.start_ns < (2**64 if end_ns is None else end_ns)
        if is_within and (connections is None or self._connection in connections):
            yield self._raw
