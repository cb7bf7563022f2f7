"""What of a log a viewer can show: its cameras, scans and frames, as far as messages of them are there."""

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

from mcap_landmarks.channels import (
    BASE_FRAME,
    CAMERA_IMAGE,
    MAP,
    MAP_MARKERS,
    MAP_POSE,
    MATCH,
    ODOMETRY,
    POSE,
    RESULTS,
    SCAN,
    SCENE_OBJECTS,
    TRUTH_POSE,
    shared_namespaces,
)
from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.cameras import info_topic, without_transport
from mcap_landmarks.inspection.topic_roles import Choice, choose, chosen_before
from mcap_landmarks.manifest import StageRecord, stage_records
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.header import frame_in
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.transforms import TFMessage, frames_in
from mcap_landmarks.messages.video import CompressedVideo
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import Channel, Connection

_FRAME_OF = (POSE, MAP_POSE, MAP_MARKERS, MAP, TRUTH_POSE)
"""The channels whose frame everything is shown in, the first of them that is there."""
_IMAGES = (CompressedImage, Image, CompressedVideo)
_MOST_EMPTY = 200
"""So many arrays of markers without a marker, which name no frame, are passed over."""


@dataclass(frozen=True, slots=True)
class ViewedCamera:
    """The connections of a camera's images, of its CameraInfo, and of the annotations that go over its images."""

    image: Connection
    info: Connection | None
    annotations: tuple[Connection, ...]


class ViewedLog:
    """What of an open recording can be shown; topics without a message are not there."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.counts = {entry.connection: entry.count for entry in recording.channels if entry.count}
        self.records = stage_records(recording.metadata)
        self._frames: dict[Connection, str] = {}

    def of(self, *messages: type[Message]) -> list[Connection]:
        """The connections of some types of messages, by topic."""
        types = {message.ROS_TYPE for message in messages}
        return sorted((one for one in self.counts if one.read_as in types), key=lambda one: one.topic)

    def on(self, topic: str) -> Connection | None:
        """The connection of a topic, the first where there are several."""
        return next((one for one in self.counts if one.topic == topic), None)

    def frame(self, connection: Connection) -> str:
        """The frame of the first message of a connection; empty where it names none."""
        if connection not in self._frames:
            self._frames[connection] = plain(self._first_frame(connection))
        return self._frames[connection]

    @cached_property
    def choice(self) -> Choice:
        """The topics that the results in the log were made of, as far as it tells."""
        images = chosen_before(self.recording, [record.options for record in self.records.values()])
        told = [topics for record in self.records.values() if isinstance(topics := _topics(record), dict)]
        scans = {role: str(topic) for topics in told for role, topic in topics.items() if role in {"scan", "odometry"}}
        return Choice({**images.topics, **scans}, images=images.images)

    @cached_property
    def cameras(self) -> tuple[ViewedCamera, ...]:
        """The cameras that boxes are of; where the log does not tell, the one camera, or every one of several."""
        images = list(self._chosen(CAMERA_IMAGE)) or self._all_images()
        infos = {one.topic: one for one in self.of(CameraInfo)}
        frames, notes = {topic: self.frame(one) for topic, one in infos.items()}, self.of(ImageAnnotations)
        found = []
        for image in images:
            info = info_topic(image.topic, self.frame(image), frames)
            nearest = max((shared_namespaces(image.topic, one.topic) for one in notes), default=0)
            over = [one for one in notes if len(images) == 1 or shared_namespaces(image.topic, one.topic) == nearest]
            found.append(ViewedCamera(image, None if info is None else infos[info], tuple(over)))
        return tuple(found)

    @cached_property
    def scans(self) -> tuple[Connection, ...]:
        """The scans or the clouds that objects were made of; where the log does not tell, all."""
        chosen = tuple(one for one in self._chosen(SCAN) if self.counts.get(one))
        found = chosen or self.of(LaserScan, MultiEchoLaserScan) or self.of(PointCloud2)
        return tuple(one for one in found if not one.topic.startswith(RESULTS))

    @cached_property
    def odometry(self) -> tuple[Connection, ...]:
        """The odometry that results in the log used; where it does not tell, the only one."""
        return tuple(one for one in self._chosen(ODOMETRY) if self.counts.get(one) and one.read_as == Odometry.ROS_TYPE)

    @cached_property
    def fixed_frame(self) -> str:
        """The frame that everything is shown in: that of poses and the map, else the first that has no parent.

        Where there is neither it is that of a scan.
        """
        for channel in _FRAME_OF:
            connection = self.on(channel.topic)
            if connection is not None and (frame := self.frame(connection)):
                return frame
        children = {child for _, child in self.edges}
        roots = [parent for parent, _ in self.edges if parent not in children]
        return next(iter(roots), "") or next((self.frame(one) for one in self.scans), "")

    @cached_property
    def base_frame(self) -> str:
        """The robot's base frame, as results name it."""
        found = (self.on(channel.topic) for channel in (MATCH, SCENE_OBJECTS))
        return next((self.frame(one) for one in found if one is not None), "") or BASE_FRAME

    @cached_property
    def edges(self) -> tuple[tuple[str, str], ...]:
        """Every parent and child that transforms tell, once."""
        found: dict[tuple[str, str], None] = {}
        for connection in self.of(TFMessage):
            for raw in self.recording.messages([connection]):
                single = frames_in(raw.data)
                if single is not None:
                    found[plain(single[0]), plain(single[1])] = None
                    continue
                with contextlib.suppress(MessageError):
                    for step in decode(TFMessage, raw.data).transforms:
                        found[plain(step.frame_id), plain(step.child_frame_id)] = None
        return tuple(found)

    def leads(self, frame: str) -> bool:
        """Whether transforms connect a frame with the fixed one."""
        return plain(frame) in self._connected

    @cached_property
    def _connected(self) -> frozenset[str]:
        known, size = {self.fixed_frame}, 0
        while size != len(known):
            size = len(known)
            known |= {name for edge in self.edges if known & {*edge} for name in edge}
        return frozenset(known)

    def _chosen(self, channel: Channel[Message]) -> Iterable[Connection]:
        try:
            return choose(self.recording, channel, self.choice)
        except UsageError:
            return ()

    def _all_images(self) -> list[Connection]:
        """Every camera's images in one form: the first of the topics that differ in their transport alone."""
        by_camera: dict[str, Connection] = {}
        for one in self.of(*_IMAGES):
            by_camera.setdefault(without_transport(one.topic), one)
        return list(by_camera.values())

    def _first_frame(self, connection: Connection) -> str:
        raws = self.recording.messages([connection])
        if connection.read_as != MarkerArray.ROS_TYPE:
            return next((frame_in(raw.data) for raw in raws), "")
        with contextlib.suppress(MessageError):
            named = (decode(MarkerArray, raw.data).frame_id for raw in islice(raws, _MOST_EMPTY))
            return next(filter(None, named), "")
        return ""


def _topics(record: StageRecord) -> object:
    return record.options.get("topics")
