"""A ROS 1 bag as output: its connections in the order of their topics, and every message that ROS 1 can hold."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain

from rosbags.rosbag1 import Writer

from mcap_landmarks.atomic import atomic_path
from mcap_landmarks.errors import MessageError
from mcap_landmarks.inspection.mcap_log import McapLog
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.qos import KEY, is_latched
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_form import CHUNK_BYTES, ChunkForm
from mcap_landmarks.runs.bag_record import custom_data_of
from mcap_landmarks.runs.conversion import Converted, Job
from mcap_landmarks.runs.output_formats import OutputFormat
from mcap_landmarks.sources import ros1_type
from mcap_landmarks.stage import Connection, RawMessage
from mcap_landmarks.wording import counted

_END_NS = 2**32 * 10**9
"""ROS 1 keeps the seconds of log times in 32 bits."""


@dataclass(slots=True)
class _Tally:
    """Messages by connection: written ones, those of them that lost fields, and those that could not be written."""

    written: Counter[Connection] = field(default_factory=Counter)
    shortened: Counter[Connection] = field(default_factory=Counter)
    misfits: Counter[Connection] = field(default_factory=Counter)
    reasons: dict[Connection, str] = field(default_factory=dict)

    def leave_out(self, connection: Connection, reason: str) -> None:
        """Count a message that cannot be written; of the reasons the first is told."""
        self.misfits[connection] += 1
        self.reasons.setdefault(connection, reason)

    def losses(self) -> list[str]:
        """In words, what ROS 1 could not take."""
        short = [
            f"{one.topic}: ROS 1's {one.message_type} lacks fields that {counted(count, 'message')} have values in"
            for one, count in self.shortened.items()
        ]
        left_out = [
            f"{one.topic}: {counted(count, 'message')} left out, since {self.reasons[one]}"
            for one, count in self.misfits.items()
        ]
        return short + left_out


def write_ros1_bag(job: Job, target: Location, form: ChunkForm | None, advance: Progress) -> Converted:
    """Write a bag of all messages.

    Raises:
        NoMessagesError: there is no message in it.
        RecordingError: the bag cannot be written.
    """
    done, span = Converted(target, OutputFormat.BAG), job.inputs.selection.span
    carried = job.holding(span[0])
    with atomic_path(target) as path:
        writer = Writer(path)
        if form and form.compression != "none":
            writer.set_compression(Writer.CompressionFormat[form.compression.upper()])
        writer.chunk_threshold = form.size_bytes if form else CHUNK_BYTES
        with writer:
            tally = _fill(writer, job.inputs.connections, chain(carried, job.inputs.messages(span, advance)))
            job.tally(done, tally.written, carried)
    job.pass_over(tally.misfits)
    job.account(done)
    done.lost += tally.misfits.total()
    done.declared += tally.misfits.total()
    done.losses = [*done.losses, *tally.losses(), *_without_place(job)]
    return done


def _fill(writer: Writer, wanted: Iterable[Connection], raws: Iterable[RawMessage]) -> _Tally:
    types = {
        one: ros1_type(one.message_type, one.schema, one.schema_encoding)
        for one in sorted(wanted, key=lambda connection: connection.topic)
    }
    connections = {
        one: writer.add_connection(
            one.topic,
            type_.message_type,
            msgdef=type_.definition,
            md5sum=type_.md5sum,
            latching=1 if is_latched(one.metadata.get(KEY, "")) else None,
        )
        for one, type_ in types.items()
    }
    tally = _Tally()
    for raw in raws:
        if raw.log_time_ns >= _END_NS:
            tally.leave_out(raw.connection, "ROS 1 has no log times after 2106")
            continue
        try:
            data, is_short = types[raw.connection].convert(raw.data)
        except MessageError as error:
            tally.leave_out(raw.connection, str(error))
            continue
        writer.write(connections[raw.connection], raw.log_time_ns, data)
        tally.written[raw.connection] += 1
        if is_short:
            tally.shortened[raw.connection] += 1
    return tally


def _without_place(job: Job) -> list[str]:
    """What the inputs have beside messages, which a ROS 1 bag cannot hold."""
    names = [name for part in job.inputs.parts if isinstance(part, McapLog) for name in part.attachment_names()]
    custom, _ = custom_data_of([one for log in job.inputs.logs for one in log.told])
    found = [f"{counted(len(names), 'attachment')} ({', '.join(names)})"] if names else []
    found += [f"custom_data ({', '.join(custom)})"] if custom else []
    return [f"a ROS 1 bag has no place for {' and '.join(found)}: left out"] if found else []
