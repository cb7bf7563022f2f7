"""An MCAP file as part of a log, its messages carried on in CDR where they can be."""

import contextlib
from collections.abc import Callable, Collection, Iterator, Sequence

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.recording.summary_index import Block
from mcap_landmarks.recording.writer import RecordingWriter
from mcap_landmarks.sources import (
    Carried,
    LossAccount,
    LostStretch,
    McapFile,
    OmittedTopic,
    Payload,
    defined,
    recorded_metadata,
    settled,
)
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage


class McapLog:
    """An MCAP file as part of a log. It is opened anew for each reading: a bag may have thousands of them.

    Messages of ROS 1 and of Foxglove's types become CDR, others are as they are. `recorded` are the channels as they
    lie in the file, `index` says where.
    """

    def __init__(self, file: McapFile) -> None:
        self._file = file
        with open_recording(file.path) as recording:
            self.index, self._damage, self._misfits = recording.index, recording.damage, 0
            self.profile, self.metadata = recording.profile, recording.metadata
            self.metadata_records = recording.metadata_records
            self.start_ns, self.end_ns = recording.start_ns, recording.end_ns
            self.losses = [f"{file.path.name}: {loss}" for loss in recording.losses]
            self.notes = [f"{file.path.name}: {note}" for note in recording.notes]
            self.recorded = tuple(recording.channels)
            self._ids = [recording.ids(entry.connection) for entry in self.recorded]
        self.about = (file.path.name, recorded_metadata(self.metadata))
        self.left_out: list[OmittedTopic] = []
        self._carried = [self._carry(entry) for entry in self.recorded]

    @property
    def channels(self) -> list[ChannelSummary]:
        """See `Log`."""
        pairs = zip(self._carried, self.recorded, strict=True)
        return [ChannelSummary(carried.connection, entry.count) for carried, entry in pairs if carried]

    @property
    def account(self) -> LossAccount:
        """See `Accounted`."""
        damage, found = self._damage, LossAccount()
        found.chunks = {chunk.offset: (chunk.messages, chunk.reason) for chunk in damage.suspect_chunks}
        if not damage.is_whole:
            found.passed_over = [LostStretch(one.start, one.end, one.reason) for one in damage.resyncs]
        if damage.cut:
            found.add("cut", None)
        if self._misfits:
            found.add("not_fitting", self._misfits)
        if damage.expected is None:
            found.is_open = bool(damage.losses)
        else:
            found.undeclared = max(damage.expected - sum(entry.count for entry in self.recorded), 0)
        return found

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
        with open_recording(self._file.path, known=self.index) as recording:
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
        with self._opened() as recording:
            wanted = self._wanted(recording, connections)
            for raw in recording.messages(list(wanted), start_ns, end_ns, progress):
                carried = self._convert(raw, wanted[raw.connection])
                if carried is not None:
                    yield carried

    def attachment_names(self) -> list[str]:
        """The names of the file's attachments that can be read."""
        with self._opened() as recording:
            return [attachment.name for attachment in recording.attachments()]

    def check_attachments(self) -> None:
        """Read the file's attachments, to know of those that are damaged."""
        with self._opened() as recording:
            for _ in recording.attachments():
                pass

    def pieces(
        self,
        connections: Collection[Connection],
        kept: Collection[Connection],
        declared: Declared,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage | WholeChunk]:
        """See `Recording.pieces`."""
        with self._opened() as recording:
            wanted = self._wanted(recording, connections)
            own = [connection for connection, carried in wanted.items() if carried.connection in kept]
            for piece in recording.pieces(list(wanted), own, declared, start_ns, end_ns, progress):
                carried = piece if isinstance(piece, WholeChunk) else self._convert(piece, wanted[piece.connection])
                if carried is not None:
                    yield carried

    def blocks(self, connections: Collection[Connection]) -> Sequence[Block] | None:
        """See `Recording.blocks`."""
        with self._opened() as recording:
            return recording.blocks(list(self._wanted(recording, connections)))

    def ids(self) -> dict[Connection, tuple[int, int]]:
        """The ids that channels and their schemas have in the file, by connection; not of those that become others."""
        return {
            carried.connection: ids
            for carried, entry, ids in zip(self._carried, self.recorded, self._ids, strict=True)
            if carried and carried.connection.message_encoding == entry.connection.message_encoding
        }

    def _wanted(self, recording: Recording, connections: Collection[Connection] | None) -> dict[Connection, Carried]:
        return {
            entry.connection: carried
            for entry, carried in zip(recording.channels, self._carried, strict=True)
            if carried and (connections is None or carried.connection in connections)
        }

    def _convert(self, raw: RawMessage, carried: Carried) -> RawMessage | None:
        try:
            data = carried.convert(raw.data)
        except MessageError as error:
            self._misfits += 1
            self._lose(f"{carried.connection.topic}: {error}; such messages are left out")
            return None
        return RawMessage(carried.connection, raw.log_time_ns, raw.publish_time_ns, raw.sequence, data)

    def copy_attachments(self, writer: RecordingWriter) -> None:
        """Carry the file's attachments over."""
        with self._opened() as recording:
            for attachment in recording.attachments():
                writer.attach(attachment)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[Recording]:
        """The file; what of it cannot be read is told at the end."""
        with open_recording(self._file.path, known=self.index) as recording:
            yield recording
            self._damage = recording.damage
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
