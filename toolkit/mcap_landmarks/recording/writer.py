"""Write recordings: chunked, indexed, checksummed, and whole or not at all."""

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from operator import itemgetter
from typing import BinaryIO

from mcap import records

from mcap_landmarks import memory
from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.channels import MAP, MAP_MARKERS, MAP_PATH, TF_STATIC, TRUTH_OBJECTS
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import CONTENT, RUN, STAGE, entry_text
from mcap_landmarks.messages.codec import Message, encode
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.video import CompressedVideo, TheoraPacket
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.chunk_form import CHUNK_NS, LARGE_BYTES, ChunkForm, OpenChunk
from mcap_landmarks.recording.chunk_output import ChunkOutput
from mcap_landmarks.recording.container import MAGIC, MESSAGE, MESSAGE_FIXED, Opcode, serialize
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.shared_channels import result_connection
from mcap_landmarks.recording.summary import attachment_index, summary_section
from mcap_landmarks.recording.summary_index import MetadataRecord
from mcap_landmarks.stage import Channel, Connection, RawMessage, Stamped

ROS2 = "ros2"
"""The profile of recordings whose messages are all of CDR, each with its definition."""
_MESSAGE = Opcode.MESSAGE.value
_IMAGE_TYPES = frozenset(message.ROS_TYPE for message in (Image, CompressedImage, CompressedVideo, TheoraPacket))
_CLOUD_TYPE = "sensor_msgs/msg/PointCloud2"
_LATCHED = frozenset(channel.topic for channel in (TF_STATIC, MAP, MAP_MARKERS, MAP_PATH, TRUTH_OBJECTS))


def profile_of(connections: Iterable[Connection]) -> str:
    """The profile of a recording with some connections: ROS 2's if all are of CDR with definitions, else none.

    What ROS 2 reads by that profile is refused whole, by rosbags for one, where a single channel is another.
    """
    every = {(one.message_encoding, one.schema_encoding) for one in connections}
    return ROS2 if every <= {("cdr", "ros2msg"), ("cdr", "ros2idl")} else ""


@contextlib.contextmanager
def create_recording(
    path: Location,
    metadata: Mapping[str, Mapping[str, str]] | None = None,
    *,
    profile: str = ROS2,
    is_passing: bool = False,
    form: ChunkForm | None = None,
    carried: Iterable[MetadataRecord] = (),
) -> Iterator["RecordingWriter"]:
    """A writer whose file takes the name `path` when the block ends well and vanishes when it does not.

    `profile` is that of the channels, see `profile_of`. One that `is_passing`, which is read once and removed, is
    compressed in a quarter of the time, and less; `form` is how its chunks look otherwise. `carried` are metadata
    records of other recordings; those that have a name of `metadata` are left out.

    Raises:
        UsageError, RecordingError: the file cannot be written; nothing is left behind.
    """
    memory.keep_room()
    with atomic_file(path) as stream:
        form = form or ChunkForm("lz4" if is_passing else "zstd", is_for_images=False)
        writer = RecordingWriter(stream, form, profile=profile, carried=carried)
        for name, entries in (metadata or {}).items():
            writer.metadata[name] = dict(entries)
        try:
            yield writer
            writer.finish()
        finally:
            writer.close()


class RecordingWriter:
    """Writes one recording to a stream; made by `create_recording`.

    Every image channel gets uncompressed chunks of its own, every channel of clouds zstd chunks of its own (lz4 in a
    passing recording); the others share such chunks, results with those of their stage. A chunk ends after 1 MiB or
    5 s. What `metadata` holds when the file is finished goes into it, one record per name; a manifest with a
    fingerprint is bound to the content.
    """

    def __init__(
        self, stream: BinaryIO, form: ChunkForm, *, profile: str = ROS2, carried: Iterable[MetadataRecord] = ()
    ) -> None:
        self.metadata: dict[str, dict[str, str]] = {}
        self.counts: dict[str, int] = {}
        self._carried = tuple(carried)
        self._stream, self._form = stream, form
        self._output = ChunkOutput(stream, form)
        self._connections: dict[Connection, tuple[int, str]] = {}
        self._own: dict[tuple[str, str], Connection] = {}
        self._declared = Declared()
        self._message_counts: dict[int, int] = {}
        self._chunks: dict[str, OpenChunk] = {}
        self._attachments: list[records.AttachmentIndex] = []
        self._output.put(MAGIC + serialize(records.Header(profile=profile, library="mcap-landmarks")))

    def declare(self, connection: Connection) -> None:
        """Give a connection its channel, also if no message of it comes."""
        if connection not in self._connections:
            self._start(connection, self._declared.declare(connection))

    def keep(self, connection: Connection, channel_id: int, schema_id: int) -> bool:
        """Declare a connection under the ids that it has in another recording; False if other channels have them."""
        data = self._declared.keep(connection, channel_id, schema_id) if connection not in self._connections else None
        if data is not None:
            self._start(connection, data)
        return data is not None

    def _start(self, connection: Connection, data: bytes) -> None:
        self._output.put(data)
        channel_id = self._declared.ids[connection]
        self._message_counts[channel_id] = 0
        self.counts.setdefault(connection.topic, 0)
        own = connection.metadata.get(STAGE, "")
        group = own
        if connection.message_type in _IMAGE_TYPES:
            group = f"image {channel_id}"
        elif connection.message_type == _CLOUD_TYPE and not own:
            group = f"cloud {channel_id}"
        self._connections[connection] = (channel_id, group)

    def write(self, raw: RawMessage) -> None:
        """Write a message as it is, on the channel of its connection."""
        connection, time_ns, publish_time_ns, sequence, payload = raw
        if connection not in self._connections:
            self.declare(connection)
        channel_id, group = self._connections[connection]
        chunk = self._chunks.get(group)
        if chunk is None:
            chunk = self._chunks[group] = OpenChunk(
                compressed=self._form.compresses(is_image=group.startswith("image "))
            )
        length, entries = len(payload), chunk.index[channel_id]
        entries.append(time_ns)
        entries.append(chunk.size)
        head = MESSAGE.pack(_MESSAGE, MESSAGE_FIXED + length, channel_id, sequence, time_ns, publish_time_ns)
        if length >= LARGE_BYTES and type(payload) is bytes:
            chunk.take(head, payload)
        else:
            chunk.data += head
            chunk.data += payload
        chunk.size += len(head) + length
        chunk.start_ns = min(chunk.start_ns, time_ns)
        chunk.end_ns = max(chunk.end_ns, time_ns)
        self._message_counts[channel_id] += 1
        self.counts[connection.topic] += 1
        if chunk.size >= self._form.size_bytes or chunk.end_ns - chunk.start_ns >= CHUNK_NS:
            for name in [key for key, other in self._chunks.items() if time_ns - other.start_ns >= CHUNK_NS]:
                self._output.chunk(self._chunks.pop(name))
            if group in self._chunks:
                self._output.chunk(self._chunks.pop(group))

    def add(self, stamped: Stamped, stage: str = "") -> None:
        """Encode a message of ours, a result of `stage` if it is one, and write it; it is published when logged."""
        connection = self.connection(stamped.channel, stage)
        sequence = self.counts.get(connection.topic, 0)
        time_ns = stamped.log_time_ns
        self.write(RawMessage(connection, time_ns, time_ns, sequence, encode(stamped.message)))

    def connection(self, channel: Channel[Message], stage: str = "") -> Connection:
        """The connection that messages of a channel of ours go to; that of results names their stage."""
        if (channel.topic, stage) not in self._own:
            latched, ros_type = channel.topic in _LATCHED, channel.message.ROS_TYPE
            self._own[channel.topic, stage] = result_connection(channel.topic, ros_type, stage, latched=latched)
        return self._own[channel.topic, stage]

    def attach(self, attachment: records.Attachment) -> None:
        """Carry an attachment over from another recording."""
        data = serialize(attachment)
        self._attachments.append(attachment_index(attachment, self._output.offset, len(data)))
        self._output.put(data)

    def finish(self) -> None:
        """Write what is left, the metadata and the summary; afterwards the file is complete."""
        for group in sorted(self._chunks, key=lambda name: self._chunks[name].start_ns):
            self._output.chunk(self._chunks.pop(group))
        if "fingerprint" in self.metadata.get(RUN, {}):
            self.metadata[RUN][CONTENT] = entry_text(self._output.content_hash)
        metadata_indexes = []
        carried = [record for record in self._carried if record[0] not in self.metadata]
        for name, entries in sorted([*carried, *self.metadata.items()], key=itemgetter(0)):
            data = serialize(records.Metadata(name=name, metadata=dict(sorted(entries.items()))))
            metadata_indexes.append(records.MetadataIndex(length=len(data), name=name, offset=self._output.offset))
            self._output.put(data)
        self._output.put(serialize(records.DataEnd(data_section_crc=self._output.crc)))
        first_ns, last_ns = self.times_ns() or (0, 0)
        statistics = records.Statistics(
            message_count=sum(self._message_counts.values()),
            schema_count=len(self._declared.schemas),
            channel_count=len(self._declared.channels),
            attachment_count=len(self._attachments),
            metadata_count=len(metadata_indexes),
            chunk_count=len(self._output.chunk_indexes),
            message_start_time=first_ns,
            message_end_time=last_ns,
            channel_message_counts={key: count for key, count in self._message_counts.items() if count},
        )
        groups: list[list[records.McapRecord]] = [
            list(self._declared.schemas.values()),
            list(self._declared.channels.values()),
            [statistics],
            list(self._output.chunk_indexes),
            list(self._attachments),
            list(metadata_indexes),
        ]
        self._stream.write(summary_section(groups, self._output.offset))

    def close(self) -> None:
        """End what was begun, whether all of it is written or not."""
        self._output.close()

    def copy(self, chunk: WholeChunk) -> None:
        """Write a chunk of another recording as it is; its channels have the ids that they have there.

        What was written to the same channels before lies before it in the file.
        """
        for name, other in list(self._chunks.items()):
            if other.index.keys() & chunk.counts.keys() or chunk.log_time_ns - other.start_ns >= CHUNK_NS:
                self._output.chunk(self._chunks.pop(name))
        for channel_id, count in chunk.counts.items():
            self._message_counts[channel_id] += count
            self.counts[self._declared.channels[channel_id].topic] += count
        self._output.copy(chunk)

    def count(self, connection: Connection) -> int:
        """How many messages of a connection that is declared are written."""
        return self._message_counts[self._declared.ids[connection]]

    def times_ns(self) -> tuple[int, ...]:
        """The first and the last log time of what is written, none if nothing is."""
        starts = [chunk.message_start_time for chunk in self._output.chunk_indexes]
        ends = [chunk.message_end_time for chunk in self._output.chunk_indexes]
        starts += [chunk.start_ns for chunk in self._chunks.values()]
        ends += [chunk.end_ns for chunk in self._chunks.values()]
        return (min(starts), max(ends)) if starts else ()

    def declared(self) -> Declared:
        """The channels and schemas so far."""
        return self._declared
