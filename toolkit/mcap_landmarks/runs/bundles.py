"""One recording as the bundles that a stage reads, in one pass."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, ODOMETRY, TF_STATIC
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.geometry.frames import is_rigid, plain
from mcap_landmarks.inspection.camera_images import CameraImages
from mcap_landmarks.inspection.examination import Examined
from mcap_landmarks.inspection.format_checks import told_formats
from mcap_landmarks.inspection.odometry_examination import STRAY
from mcap_landmarks.inspection.topic_roles import ROLES, Choice, choose, could_be, message_type
from mcap_landmarks.lidar.scan_repair import ScanTopic
from mcap_landmarks.maps.scene_objects import usable
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.spatial_objects import seen_from_above
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.layered_log import LayeredLog
from mcap_landmarks.recording.odometry_track import OdometryTrack
from mcap_landmarks.recording.time_association import Association, associate
from mcap_landmarks.stage import Bundle, Channel, Connection, RawMessage, Readable

HELD = (CAMERA_INFO, TF_STATIC)
"""Channels of which a bundle gets the latest message that came not much later, however old."""
_OF_CAMERAS = (CAMERA_INFO, DETECTIONS)
"""Channels of which a bundle gets a message for every camera."""


Frames = Mapping[Connection, str]
"""The frames of several cameras, by the connections of their images and CameraInfos."""
Images = Mapping[Connection, CameraImages]
"""The images that CameraInfos go with, by the connections of these."""
_Timed = ScanObjects | ClusteredCloud | SceneVelocities | LaserScan | PointCloud2 | Detections | SceneObjects
"""Messages that meet others by their stamps."""


@dataclass(frozen=True, slots=True)
class Span:
    """What of a recording is read: topics by role, and log times from `start_ns` on and before `end_ns`."""

    choice: Choice = field(default_factory=Choice)
    start_ns: int | None = None
    end_ns: int | None = None


@dataclass(slots=True)
class Reading:
    """What became of a recording's messages: what was associated, dropped or repaired by rule, or lost to damage."""

    association: Association = field(default_factory=Association)
    dropped: Counter[str] = field(default_factory=Counter)
    losses: list[str] = field(default_factory=list)
    unreadable: Counter[str] = field(default_factory=Counter)
    useless: int = 0
    """Bundles of whose message a stage could make nothing, such as an image that is damaged."""
    topics: dict[str, str] = field(default_factory=dict)
    """The log's own topic for a channel's."""
    shifts_ns: dict[int, int] = field(default_factory=dict)
    """By log time, how far stamps were moved since their clock had been set back: results have them as they were."""

    def name(self, inputs: Mapping[Connection, Channel[Message]]) -> None:
        """Note the log's own topics."""
        self.topics.update({channel.topic: connection.topic for connection, channel in inputs.items()})

    def lose(self, topic: str, log_time_ns: int, reason: str) -> None:
        """Count a message that cannot be read; the first of a topic is told in full."""
        self.unreadable[topic] += 1
        if self.unreadable[topic] == 1:
            self.losses.append(f"{topic} at {moment(log_time_ns)}: {reason}")

    def close(self, losses: Iterable[str]) -> None:
        """Sum up when everything was read; `losses` are the recording's own."""
        self.losses.extend(
            f"{topic}: {count} messages could not be decoded in all"
            for topic, count in self.unreadable.items()
            if count > 1
        )
        self.losses.extend(losses)

    def notes(self) -> dict[str, int]:
        """Everything that was left out or repaired by rule, in words, with its count; nothing where nothing was."""
        association = self.association
        found = Counter(self.dropped)
        found["bundles without odometry at their time"] += association.without_odometry
        for topic, count in association.alone.items():
            found[f"bundles without {self.topics.get(topic, topic)} at their time"] += count
        for topic, count in association.unpaired.items():
            found[f"messages of {self.topics.get(topic, topic)} that were nearest to no bundle"] += count
        return {reason: count for reason, count in sorted(found.items()) if count}


def inputs_of(
    recording: LayeredLog, reads: Iterable[Channel[Message]], required: Iterable[Channel[Message]], choice: Choice
) -> dict[Connection, Channel[Message]]:
    """The connections that a stage reads, each with the channel it stands for.

    Raises:
        RecordingError: a required input is missing or has no messages.
        UsageError: see `choose`.
    """
    found: dict[Connection, Channel[Message]] = {}
    counts = {entry.connection: entry.count for entry in recording.channels}
    needed = set(required)
    for channel in reads:
        connections = choose(recording, channel, choice)
        for connection in connections:
            if found.get(connection, TF_STATIC) == TF_STATIC:  # what is also odometry gives transforms all the same
                found[connection] = channel
        if channel in needed and not sum(counts[connection] for connection in connections):
            raise RecordingError(_missing(recording, channel, bool(connections)))
    return found


def _missing(recording: LayeredLog, channel: Channel[Message], empty: bool) -> str:
    role, damage = ROLES.get(channel), recording.told_damage()
    if empty:
        name = role.name if role else channel.topic
        return f"{recording.path}: the {name} topic has no messages; {damage or 'record it, or choose another log'}"
    if role is None:
        remedy = f"run the stage that writes it first, or read another topic as it with --remap TOPIC={channel.topic}"
        return f"{recording.path}: there is no {channel.topic}; {damage or remedy}"
    types = " or ".join(role.types)
    present = [(entry.connection.topic, entry.connection.message_type) for entry in recording.channels]
    remedy = f"choose a topic with {role.option}, or take a log that has one, such as {channel.topic}"
    hint = told_formats(recording.channels) or could_be(present, channel)
    told = "; ".join(filter(None, (hint, damage))) or remedy
    return f"{recording.path}: there is no {role.name} ({types}); {told}"


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """What is done to messages before they are associated.

    `examined` tells clocks, frames and odometry; `frames` are those of several cameras: drivers often give images
    another one than their CameraInfo. `images` are those that CameraInfos become those of; `calibrated` have some
    CameraInfo with a focal length, so that one without tells nothing.
    """

    examined: Examined | None = None
    frames: Frames = field(default_factory=dict)
    images: Images = field(default_factory=dict)
    calibrated: Collection[Connection] = ()

    @property
    def track(self) -> OdometryTrack:
        """The odometry, empty where there is none."""
        odometry = self.examined.odometry if self.examined else None
        return (odometry.track if odometry else None) or OdometryTrack.empty()

    def moment(self, raw: RawMessage, stamp_ns: int, shifts_ns: dict[int, int]) -> int | None:
        """The stamp that counts, None where a message's is stray; how far it is moved is noted by log time."""
        clock = self.examined.clocks.get(raw.connection) if self.examined else None
        if clock is None or clock.is_plain(stamp_ns):
            return stamp_ns
        if shift_ns := clock.shift_ns(raw.log_time_ns, stamp_ns):
            shifts_ns[raw.log_time_ns] = shift_ns
        return clock.moment(raw.log_time_ns, stamp_ns)

    def is_foreign(self, connection: Connection, frame: str) -> bool:
        """Whether a frame is not that of a connection's messages."""
        return self.examined is not None and plain(frame) in self.examined.foreign.get(connection, ())


def read_bundles(
    raws: Iterable[RawMessage],
    inputs: Mapping[Connection, Channel[Message]],
    reads: Sequence[Channel[Message]],
    reading: Reading,
    correction: Correction,
    seeds: Iterable[tuple[Channel[Message], int, Message]] = (),
) -> Iterator[Bundle]:
    """The bundles of messages by log time, one per message of the first channel of `reads`.

    They get odometry if `reads` has it, wait for transforms and camera information if the recording has any, and get
    of every other channel of `reads` the message nearest in time, of detections that of every camera. `seeds` hold from
    the start on, until others of their kind come. `reading` is kept up to date.

    A message that cannot be decoded is a loss, an unusable object is dropped, a scan that is not as the standard has it
    is repaired; all are counted.
    """
    reading.name(inputs)
    present = {*inputs.values()} | {TF_STATIC for entry in inputs if entry.message_type == TFMessage.ROS_TYPE}
    others = [channel for channel in reads[1:] if channel != ODOMETRY and channel in present]
    return associate(
        chain(seeds, decoded(raws, inputs, reading, correction)),
        reads[0],
        reading.association,
        odometry=correction.track if ODOMETRY in reads else None,
        held=[channel for channel in others if channel in HELD],
        beside=[channel for channel in others if channel not in HELD],
        by_frame={channel: _frame_count(channel, inputs, correction.frames) for channel in _OF_CAMERAS},
    )


def _frame_count(channel: Channel[Message], inputs: Mapping[Connection, Channel[Message]], frames: Frames) -> int:
    """How many frames there will be of a channel, as far as that is known: one, else those of its connections."""
    return len({frames.get(connection, "") for connection, known in inputs.items() if known == channel}) or 1


def held_before(
    recording: Readable, inputs: Mapping[Connection, Channel[Message]], start_ns: int | None
) -> Iterator[RawMessage]:
    """Messages of held inputs from before the time that reading starts at: transforms most often come only once."""
    held = [connection for connection, channel in inputs.items() if channel in HELD]
    if start_ns is not None and held:
        yield from recording.messages(held, None, start_ns)


def decoded(
    raws: Iterable[RawMessage],
    inputs: Mapping[Connection, Channel[Message]],
    reading: Reading,
    correction: Correction = Correction(),
) -> Iterator[tuple[Channel[Message], int, Message]]:
    """The messages of inputs with their channels and log times, corrected; transforms also where they are odometry.

    Raises:
        RecordingError: scene objects are in a frame that no transforms lead from to the robot's.
    """
    scans = defaultdict[Connection, ScanTopic](ScanTopic)
    for raw in raws:
        channel = inputs.get(raw.connection)
        if channel is None or (channel == ODOMETRY and raw.connection.message_type != TFMessage.ROS_TYPE):
            continue  # odometry was examined as a whole
        try:
            message: Message = decode(message_type(channel, raw.connection), raw.data)
            if isinstance(message, LaserScan | MultiEchoLaserScan):
                message, repairs = scans[raw.connection].take(message)
                reading.dropped.update(repairs)
            elif isinstance(message, CameraInfo) and raw.connection in correction.images:
                message = correction.images[raw.connection].read(message)
        except (MessageError, RecordingError) as error:
            reading.lose(raw.connection.topic, raw.log_time_ns, str(error))
            continue
        if isinstance(message, TFMessage):  # one message may hold odometry and where a sensor is
            yield TF_STATIC, raw.log_time_ns, _rigid(message, reading.dropped)
            continue
        corrected = _corrected(message, raw, correction, reading)
        if corrected is not None:
            yield channel, raw.log_time_ns, corrected


def _corrected(message: Message, raw: RawMessage, correction: Correction, reading: Reading) -> Message | None:
    """A message with the stamp and in the frame that count, None where these or its numbers cannot be."""
    if raw.connection in correction.frames and isinstance(message, CameraInfo | CompressedImage | Image):
        message = replace(message, frame_id=correction.frames[raw.connection])
    if isinstance(message, CameraInfo) and raw.connection in correction.calibrated and not message.is_calibrated:
        reading.dropped[f"messages of {raw.connection.topic} without a focal length, which others have"] += 1
        return None
    if isinstance(message, _Timed):
        if correction.is_foreign(raw.connection, message.frame_id):
            reading.dropped[f"messages of {raw.connection.topic} of another frame than the others"] += 1
            return None
        moment_ns = correction.moment(raw, message.stamp_ns, reading.shifts_ns)
        if moment_ns is None:
            reading.dropped[f"messages of {raw.connection.topic} {STRAY}"] += 1
            return None
        message = message if moment_ns == message.stamp_ns else replace(message, stamp_ns=moment_ns)
    if isinstance(message, SceneObjects):
        message = usable(_in_base(message, raw, correction.examined), reading.dropped)
    return message


def _in_base(scene: SceneObjects, raw: RawMessage, examined: Examined | None) -> SceneObjects:
    """Scene objects of anyone in the robot's own frame, where those of results are."""
    if examined is None or raw.connection not in examined.clocks:
        return scene
    base_from_frame = examined.frames.base_from(examined.base, scene.frame_id, f"objects on {raw.connection.topic} are")
    if np.array_equal(base_from_frame, np.eye(4)):
        return scene
    return seen_from_above(scene, raw.data, examined.base, base_from_frame)


def _rigid(message: TFMessage, dropped: Counter[str]) -> TFMessage:
    """Transforms without those that are none."""
    good = tuple(step for step in message.transforms if is_rigid(step.translation_m, step.rotation_xyzw))
    if len(good) == len(message.transforms):
        return message
    dropped["transforms with a quaternion of zeros or numbers that are not finite"] += len(message.transforms) - len(
        good
    )
    return TFMessage(good)
