"""A log, opened to look into: its channels, what its sensors sent, and what stages and the generator wrote."""

import weakref
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from functools import cached_property
from types import TracebackType
from typing import Self

from mcap_landmarks.api import log_tables
from mcap_landmarks.api.arguments import AnyPath, Moment, moment_ns, pairs, place, tell
from mcap_landmarks.api.logged_items import LoggedCloud, LoggedImage, LoggedScan
from mcap_landmarks.api.parameter_names import naming_parameters
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, MATCH, ODOMETRY, SCAN, SCENE_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.evaluation.pose_topics import poses_in
from mcap_landmarks.inspection.info import ChannelInfo, LogInfo, describe
from mcap_landmarks.inspection.topic_roles import ROLES, Choice, parse_remaps
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import M, Message, decode
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.layered_log import Layer, LayeredLog
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.recording.reader import open_recording, reading_from_front
from mcap_landmarks.runs.bundles import Reading, Span, decoded, inputs_of
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.stage import Channel, Connection, RawMessage
from mcap_landmarks.structured import StructuredArray
from mcap_landmarks.wording import counted

_Inputs = Mapping[Connection, Channel[Message]]
_TOPIC = {"image": "topic", "scan": "topic", "odom": "topic"}
"""What chooses a topic of one kind in all verbs is called so where only that kind is read."""


@naming_parameters()
def open_log(
    path: AnyPath,
    *,
    start: Moment | None = None,
    end: Moment | None = None,
    remap: Mapping[str, str] | None = None,
    lenient: bool = False,
) -> "LogReader":
    """A recording (MCAP) to look into, from log time `start` on and before `end`.

    `remap` reads topics as others, FROM to TO; with `lenient` no index in the file is taken at its word.

    Raises:
        RecordingError: there is no such file, or it is not an MCAP file.
        UsageError: no message lies between start and end, or an argument is not of its type.
    """
    choice = Choice(remaps=parse_remaps(pairs(remap, "remap")))
    return LogReader(
        place(path, "path"), Span(choice, moment_ns(start, "start"), moment_ns(end, "end")), reads_from_front=lenient
    )


class LogReader:
    """An open recording; made by `open_log`. It closes itself when it is no longer used, `with` closes it earlier.

    `start_ns` and `end_ns` are the first and last log time. Images, scans and clouds come one by one, so that logs may
    be of any length; everything else comes as a whole table. Topics are found by their type, as the verbs find them;
    where several fit, the error lists them, and `topic` chooses. What cannot be read is left out, told by a
    `LossWarning`, and listed in `losses`. Once it is closed, reading raises a `UsageError`.
    """

    def __init__(self, path: Location, span: Span, *, reads_from_front: bool) -> None:
        self.path = path
        self._span, self._reads_from_front = span, reads_from_front
        self._losses: dict[str, None] = {}
        self._notes: dict[str, None] = {}
        stack = ExitStack()
        self.close = weakref.finalize(self, stack.close)
        self._recording = stack.enter_context(open_recording(path, from_front=reads_from_front))
        self.start_ns, self.end_ns = self._recording.start_ns, self._recording.end_ns
        self._tell([])
        self._log(span.choice)  # says so if nothing lies in the span

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        count = sum(channel.count for channel in self.channels)
        lasts = f"{moment(self.start_ns)} to {moment(self.end_ns)}, " if self.start_ns and self.end_ns else ""
        width = max((len(channel.topic) for channel in self.channels), default=0)
        lines = [
            f"  {channel.topic:{width}}  {channel.count:>7}  {channel.message_type}  {channel.role or ''}".rstrip()
            for channel in self.channels
        ]
        return "\n".join([f"<LogReader of {self.path}: {lasts}{counted(count, 'message')}>", *lines])

    @property
    def channels(self) -> tuple[ChannelInfo, ...]:
        """Every topic with its type, number of messages, mean rate, and the role that it plays for the verbs."""
        return self._info.channels

    @property
    def losses(self) -> tuple[str, ...]:
        """What could not be read so far, in words."""
        return tuple(self._losses)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out by a rule so far, in words."""
        return tuple(self._notes)

    def images(self, topic: str | None = None) -> Iterator[LoggedImage]:
        """The images of a camera, one by one.

        Raises:
            RecordingError: there are none.
            UsageError: several topics fit, or the one that was chosen does not.
        """
        found = self._messages(CAMERA_IMAGE, topic)
        return (
            LoggedImage(message.stamp_ns, log_ns, name, message.frame_id, message)
            for name, log_ns, message in found
            if isinstance(message, CompressedImage | Image)
        )

    def scans(self, topic: str | None = None) -> Iterator[LoggedScan]:
        """The scans of a planar LiDAR, one by one; raises as `images`."""
        found = self._messages(SCAN, topic)
        return (LoggedScan.of(log_ns, name, scan) for name, log_ns, scan in found if isinstance(scan, LaserScan))

    @naming_parameters(**_TOPIC)
    def clouds(self, topic: str | None = None) -> Iterator[LoggedCloud]:
        """The point clouds of a LiDAR or depth camera, one by one; raises as `images`."""
        self._check_open()
        topics = [topic] if topic else self._info.roles["point_cloud"]
        if len(topics) != 1:
            there = f"{' and '.join(topics)} have point clouds; choose with topic" if topics else "has no point clouds"
            raise (UsageError if topics else RecordingError)(f"{self.path}: {there}")
        found = self._messages(SCAN, topics[0])
        return (LoggedCloud.of(log_ns, name, cloud) for name, log_ns, cloud in found if isinstance(cloud, PointCloud2))

    @naming_parameters(**_TOPIC)
    def odometry(self, topic: str | None = None) -> StructuredArray:
        """A row per message of odometry as it was recorded, in the plane, with the base's own velocity.

        Where it comes as transforms or poses nothing is known of velocity and covariance: they are zero.

        Raises:
            RecordingError: there is none.
            UsageError: several topics fit, or the one that was chosen does not.
        """
        log, inputs = self._inputs(ODOMETRY, topic)
        tables = [self._columns(entry) for entry in inputs if entry.read_as == Odometry.ROS_TYPE]
        others = {entry: channel for entry, channel in inputs.items() if entry.read_as != Odometry.ROS_TYPE}
        if others or not tables:
            found = ((log_ns, odometry_from(message)) for _, log_ns, message in self._decoded(log, others))
            tables.append(log_tables.odometry_table((log_ns, one) for log_ns, one in found if one is not None))
        return log_tables.by_log_time(tables)

    def detections(self, topic: str | None = None) -> StructuredArray:
        """A row per box in an image, with its most probable class; raises as `odometry`."""
        return log_tables.detection_table(self._of(DETECTIONS, topic))

    def scene_objects(self, topic: str | None = None) -> StructuredArray:
        """A row per object of a scene, with its most probable class, in the frame of the robot; raises as `odometry`.

        The topic `/ground_truth/objects` has the true ones, in the map's frame.
        """
        return log_tables.scene_table(self._of(SCENE_OBJECTS, topic))

    def matches(self, topic: str | None = None) -> StructuredArray:
        """A row per bundle: what came of localizing it, and which objects were matched; raises as `odometry`."""
        return log_tables.match_table(self._of(MATCH, topic))

    @naming_parameters(**_TOPIC)
    def poses(self, topic: str | None = None, child: str | None = None) -> StructuredArray:
        """A row per pose in the plane, by its stamp: of what localize found, else of what `export` would take.

        Of a topic of transforms those to the frame `child` are taken. What is not known is NaN.

        Raises:
            RecordingError: there are none.
            UsageError: several topics or frames fit, or the one that was chosen does not.
        """
        self._check_open()
        track = poses_in(self._recording, topic, child, (self._span.start_ns, self._span.end_ns))
        self._notes.update(dict.fromkeys(track.notes))
        self._tell(track.losses)
        return log_tables.pose_table(track)

    def ground_truth(self) -> StructuredArray:
        """As `poses`: where the robot was, as the log's truth tells.

        Raises:
            RecordingError: the log has no truth.
        """
        self._check_open()
        if not self._recording.connections(TRUTH_POSE.topic):
            raise RecordingError(f"{self.path}: there is no {TRUTH_POSE.topic}; open a log with truth")
        return self.poses(TRUTH_POSE.topic)

    def _check_open(self) -> None:
        if not self.close.alive:
            raise UsageError(f"{self.path}: the log is closed; read it before that, or open it again")

    @cached_property
    def _info(self) -> LogInfo:
        with reading_from_front() if self._reads_from_front else nullcontext():
            return describe(self.path, {})[0]

    def _log(self, choice: Choice) -> LayeredLog:
        """The log as stages see it, results included, its videos as images."""
        self._check_open()
        log = RecordedLog(self._recording, replace(self._span, choice=choice))
        return log.layered([Layer(self._recording, self._recording.channels)])

    @naming_parameters(**_TOPIC)
    def _inputs(self, channel: Channel[Message], topic: str | None) -> tuple[LayeredLog, _Inputs]:
        """The connections that a channel is read from: those that the verbs would take, or those of a topic."""
        choice, role = self._span.choice, ROLES.get(channel)
        if topic is not None and role is not None:
            choice = replace(choice, topics={role.name: topic})
        log = self._log(choice)
        if topic is None or role is not None:
            return log, inputs_of(log, (channel,), (channel,), choice)
        named = [entry.connection for entry in log.channels if entry.connection.topic == topic]
        fitting = {connection: channel for connection in named if connection.read_as == channel.message.ROS_TYPE}
        if not fitting:
            there = f"is {named[0].message_type}" if named else "is not there"
            raise UsageError(f"{self.path}: {topic} {there}; choose a topic of {channel.message.ROS_TYPE}")
        return log, fitting

    def _messages(self, channel: Channel[Message], topic: str | None) -> Iterator[tuple[str, int, Message]]:
        """Topic, log time and message of each; what is wrong with the topic is told at once."""
        return self._decoded(*self._inputs(channel, topic))

    def _decoded(self, log: LayeredLog, inputs: _Inputs) -> Iterator[tuple[str, int, Message]]:
        reading, topic = Reading(), min((entry.topic for entry in inputs), default="")
        try:
            for _, log_ns, message in decoded(self._raws(log, inputs), inputs, reading):
                yield topic, log_ns, message
        finally:
            self._finish(log, reading)

    def _raws(self, log: LayeredLog, inputs: _Inputs) -> Iterator[RawMessage]:
        """The messages of the span, for as long as the log is open."""
        self._check_open()
        for raw in log.messages(inputs, self._span.start_ns, self._span.end_ns):
            yield raw
            self._check_open()

    def _of(self, channel: Channel[M], topic: str | None) -> Iterator[tuple[int, M]]:
        """Log time and message of each; those that grow are read as the log defines them."""
        log, inputs = self._inputs(channel, topic)
        if channel in ROLES:
            found = self._decoded(log, inputs)
            yield from ((log_ns, message) for _, log_ns, message in found if isinstance(message, channel.message))
            return
        reading = Reading()
        schemas = {entry: entry.schema.decode(errors="replace") for entry in inputs}
        for raw in self._raws(log, inputs):
            try:
                yield raw.log_time_ns, decode(channel.message, raw.data, schemas[raw.connection])
            except MessageError as error:
                reading.lose(raw.connection.topic, raw.log_time_ns, str(error))
        self._finish(log, reading)

    def _columns(self, connection: Connection) -> StructuredArray:
        layout = layout_of(Odometry.ROS_TYPE, definition(Odometry.ROS_TYPE))
        span, fields = (self._span.start_ns, self._span.end_ns), log_tables.ODOMETRY_FIELDS
        found = self._recording.columns(connection, layout, fields, *span)
        broken = f"{connection.topic}: {counted(found.broken, 'message')} could not be decoded"
        self._tell([broken] if found.broken else [])
        return log_tables.odometry_columns(found.log_time_ns, found.table)

    def _finish(self, log: LayeredLog, reading: Reading) -> None:
        reading.close(log.losses)
        self._notes.update({f"{count} {reason}": None for reason, count in reading.notes().items()})
        self._tell(reading.losses)

    def _tell(self, losses: Iterable[str]) -> None:
        """Note what could not be read, and warn of what was not known before."""
        new = [loss for loss in dict.fromkeys([*losses, *self._recording.losses]) if loss not in self._losses]
        self._losses.update(dict.fromkeys(new))
        tell(self.path, new)
