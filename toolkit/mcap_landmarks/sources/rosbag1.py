"""ROS 1 bags: every message becomes ROS 2 CDR, in the order of the time at which it was recorded."""

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.typestore import full_name
from mcap_landmarks.progress import Progress
from mcap_landmarks.sources._bag_container import MAGIC, BagConnection, BagMessage, ChunkInfo, DamagedBagError
from mcap_landmarks.sources._bag_index import BagIndex, read_chunk, read_index
from mcap_landmarks.sources._definition_files import DefinitionFiles
from mcap_landmarks.sources._merge import merge
from mcap_landmarks.sources._ros1_types import Convert, converted
from mcap_landmarks.sources._shape import Definition, OmittedTopic, Payload, Source, SourceLog
from mcap_landmarks.sources._verification import settled
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage
from mcap_landmarks.wording import counted


@dataclass(frozen=True, slots=True)
class Rosbag1Config:
    """definitions: files and folders with those of types that a bag does not define."""

    definitions: tuple[str, ...] = ()


def recognises(path: Path) -> bool:
    """A file named .bag, or one that begins as bags do."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return path.suffix == ".bag" or stream.read(8) == MAGIC[:8]


@contextlib.contextmanager
def open_bag(path: Path, config: Rosbag1Config) -> Iterator[Sequence[SourceLog]]:
    """The one log of a bag.

    Raises:
        RecordingError: it is no bag of format 2.0, or is encrypted.
        UsageError: there are no such definitions.
    """
    size, files = path.stat().st_size, DefinitionFiles(config.definitions)
    with path.open("rb") as stream:
        start = stream.read(len(MAGIC))
        if not start:
            raise RecordingError(f"{path} is empty (0 bytes); record or copy it again")
        if start != MAGIC:
            remedy = "bring it to format 2.0 with `rosbag migrate`" if start[:8] == MAGIC[:8] else "check the file"
            raise RecordingError(f"{path} is not a ROS 1 bag of format 2.0; {remedy}")
        try:
            index = read_index(stream, size)
        except DamagedBagError as error:
            raise RecordingError(f"{path} cannot be read: {error}; copy or decrypt it again") from error
    yield [SourceLog(path.stem, (BagLog(path, size, index, files),), size)]


class BagLog:
    """The log in a bag. Connections that differ only in their publisher share one channel."""

    def __init__(self, path: Path, size: int, index: BagIndex, files: DefinitionFiles) -> None:
        self.losses, self.account = [f"{path.name}: {loss}" for loss in index.losses], index.account
        self._path, self._size, self._chunks = path, size, [chunk for chunk in index.chunks if chunk.counts]
        self._known = frozenset(index.connections)
        self._files = files
        self._carried: dict[int, tuple[Connection, Convert]] = {}
        self._unsure: dict[Connection, list[Definition]] = {}
        self.left_out: list[OmittedTopic] = []
        self.channels = self._connect(index)
        self.start_ns = min((chunk.start_ns for chunk in self._chunks), default=None)
        self.end_ns = max((chunk.end_ns for chunk in self._chunks), default=None)
        self._misfits: Counter[Connection] = Counter()

    def _connect(self, index: BagIndex) -> list[ChannelSummary]:
        """The channels of a bag that can be carried; `_carried` and `left_out` are filled."""
        counts: Counter[BagConnection] = Counter()
        for key, count in index.counts().items():
            if key in index.connections:  # the others are told of when they are read
                counts[index.connections[key]] += count
        shared: dict[BagConnection, tuple[Connection, Convert] | None] = {}
        for key, described in sorted(index.connections.items()):
            if described not in shared:
                shared[described] = self._carry(described, counts[described])
            if carried := shared[described]:
                self._carried[key] = carried
        return [ChannelSummary(one[0], counts[described]) for described, one in shared.items() if one]

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`."""
        unsure = {one: self._unsure.pop(one) for one in list(self._unsure) if wanted(one.topic)}
        for connection, found in settled(unsure, self._payloads).items():
            if isinstance(found, str):
                self._carried = {key: one for key, one in self._carried.items() if one[0] is not connection}
                (entry,) = (entry for entry in self.channels if entry.connection is connection)
                self.channels.remove(entry)
                self.left_out.append(OmittedTopic(connection.topic, connection.message_type, entry.count, found))

    def _payloads(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, Payload]]:
        """The messages of some connections as they lie in the bag."""
        carried = {key: one for key, (one, _) in self._carried.items() if one in connections}
        for chunk in self._chunks:
            for _, key, data in self._checked(chunk, None):
                if key in carried:
                    yield carried[key], data

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`; a message that does not fit its definition is left out and told in `losses`."""
        carried = {key: one for key, one in self._carried.items() if connections is None or one[0] in connections}
        first, last = start_ns or 0, 2**64 if end_ns is None else end_ns
        chunks = [chunk for chunk in self._chunks if chunk.end_ns >= first and chunk.start_ns < last]
        return merge(
            (max(chunk.start_ns, first), partial(self._load, chunk, carried, (first, last), progress))
            for chunk in chunks
        )

    def _load(
        self,
        chunk: ChunkInfo,
        carried: dict[int, tuple[Connection, Convert]],
        within_ns: tuple[int, int],
        progress: Progress | None,
    ) -> Iterator[RawMessage]:
        """Messages of a chunk, converted."""
        first, last = within_ns
        for time_ns, key, data in self._checked(chunk, progress):
            if key in carried and first <= time_ns < last:
                connection, convert = carried[key]
                try:
                    converted_data = convert(data)
                except MessageError as error:
                    self._misfit(connection, error)
                else:
                    yield RawMessage(connection, time_ns, time_ns, 0, converted_data)

    def _checked(self, chunk: ChunkInfo, progress: Progress | None) -> Sequence[BagMessage]:
        """Messages of a chunk; what it lacks is told."""
        with self._path.open("rb") as stream:
            found, _, problem = read_chunk(stream, self._size, chunk.offset)
            if progress:
                progress(stream.tell() - chunk.offset)
        missing = sum(chunk.counts.values()) - len(found)
        where = f"the chunk at byte {chunk.offset}"
        if missing > 0 or problem:
            self.account.chunks[chunk.offset] = missing if missing > 0 else None, problem or "messages are missing"
        if missing > 0:
            why = f" ({problem})" if problem else ""
            self._lose(f"{where}{why} lacks {missing} of {counted(sum(chunk.counts.values()), 'message')}")
        elif problem:
            self._lose(f"{where} is damaged ({problem}); {counted(len(found), 'message')} before that taken")
        orphans = sum(message.connection_id not in self._known for message in found)
        if orphans and self._lose(f"{counted(orphans, 'message')} of {where} without a connection left out"):
            self.account.add("without_topic", orphans, is_declared=False)
        return found

    def _carry(self, described: BagConnection, count: int) -> tuple[Connection, Convert] | None:
        """What stands for a connection, and what converts its messages; None if nothing can."""
        try:
            type_ = converted(described.ros_type, described.definition, described.md5sum, self._files)
        except MessageError as error:
            if count:
                topic, ros_type = _topic(described.topic), full_name(described.ros_type)
                self.left_out.append(OmittedTopic(topic, ros_type, count, str(error)))
            return None
        text, metadata = type_.definition, {KEY: qos_profile(latched=described.latched)}
        connection = Connection(_topic(described.topic), type_.message_type, text.encode(), metadata=metadata)
        if not type_.is_sure:
            self._unsure[connection] = [Definition(text, type_.check)]
        return connection, type_.convert

    def _lose(self, text: str) -> bool:
        """Tell a loss; whether it was not told before."""
        text = f"{self._path.name}: {text}"
        is_new = text not in self.losses
        self.losses += [text] if is_new else []
        return is_new

    def _misfit(self, connection: Connection, error: MessageError) -> None:
        """Tell of the first message of a topic that does not fit; the counts tell of the others."""
        self._misfits[connection] += 1
        self.account.add("not_fitting")
        if self._misfits[connection] == 1:
            self._lose(f"{connection.topic}: {error}; such messages are left out")


def _topic(name: str) -> str:
    """A topic as ROS 2 has it, without empty names between its slashes."""
    return ("/" if name.startswith("/") else "") + "/".join(part for part in name.split("/") if part)


SOURCE = Source("rosbag1", "ROS 1 bags (.bag)", Rosbag1Config, recognises, open_bag)
