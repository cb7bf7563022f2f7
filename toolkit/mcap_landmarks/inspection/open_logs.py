"""Logs of any format: bags and data sets through their sources, MCAP files through the recording reader."""

import contextlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.config import Settings, stage_config
from mcap_landmarks.errors import MessageError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import RecordingWriter
from mcap_landmarks.sources import Log, McapFile, source_of
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
        logs = []
        for log in found:
            parts: list[Log] = [McapLog(part) if isinstance(part, McapFile) else part for part in log.parts]
            parts += [mount for part in parts if isinstance(part, McapLog) for mount in part.mounts()]
            size, told = log.size_bytes, (log.losses, log.notes, log.dropped)
            logs.append(OpenLog(path, log.name, source.name, config, tuple(parts), size, *told))
        yield logs


class McapLog:
    """An MCAP file as part of a log. It is opened anew for each reading: a bag may have thousands of them.

    Messages of ROS 1 and of Foxglove's types become CDR, others are as they are. `recorded` are the channels as they
    lie in the file.
    """

    def __init__(self, file: McapFile) -> None:
        self._file = file
        with open_recording(file.path) as recording:
            self.profile, self.metadata = recording.profile, recording.metadata
            self.start_ns, self.end_ns = recording.start_ns, recording.end_ns
            self.losses = [f"{file.path.name}: {loss}" for loss in recording.losses]
            self.recorded = tuple(recording.channels)
            self._carried = [file.carry(entry.connection) for entry in recording.channels]
        self.channels = [
            ChannelSummary(carried.connection, entry.count)
            for carried, entry in zip(self._carried, recording.channels, strict=True)
        ]

    def mounts(self) -> list["MountLog"]:
        """Where sensors are, of which only their messages tell."""
        found = []
        with open_recording(self._file.path) as recording:
            for entry, carried in zip(recording.channels, self._carried, strict=True):
                first = next(recording.messages([entry.connection]), None) if carried.mount else None
                if first is None or carried.mount is None:
                    continue
                with contextlib.suppress(MessageError):  # which is told where it is read
                    transforms = carried.mount(first.data)
                    if transforms is not None:
                        found.append(MountLog(first.log_time_ns, transforms))
        return found

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`."""
        with open_recording(self._file.path) as recording:
            wanted = {
                entry.connection: carried
                for entry, carried in zip(recording.channels, self._carried, strict=True)
                if connections is None or carried.connection in connections
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

    def copy_attachments(self, writer: RecordingWriter) -> None:
        """Carry the file's attachments over."""
        with open_recording(self._file.path) as recording:
            for attachment in recording.attachments():
                writer.attach(attachment)

    def _lose(self, loss: str) -> None:
        loss = f"{self._file.path.name}: {loss}"
        if loss not in self.losses:
            self.losses.append(loss)


class MountLog:
    """One TFMessage, as part of a log that tells where a sensor is in the sensor's messages."""

    def __init__(self, log_time_ns: int, transforms: bytes) -> None:
        self.start_ns = self.end_ns = log_time_ns
        self.losses: tuple[str, ...] = ()
        metadata = {KEY: qos_profile(latched=True)}
        ros_type = TFMessage.ROS_TYPE
        self._connection = Connection(TF_STATIC.topic, ros_type, definition(ros_type).encode(), metadata=metadata)
        self.channels = (ChannelSummary(self._connection, 1),)
        self._raw = RawMessage(self._connection, log_time_ns, log_time_ns, 0, transforms)

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
