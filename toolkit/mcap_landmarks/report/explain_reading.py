"""One bundle of a log with results and all that led to it, for an explanation."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import (
    CAMERA_IMAGE,
    CAMERA_INFO,
    CLUSTERED_CLOUD,
    DETECTIONS,
    MAP,
    MATCH,
    POSE,
    POSE_COVARIANCE,
    SCAN,
    SCAN_OBJECTS,
    SCENE_OBJECTS,
    SCENE_VELOCITIES,
)
from mcap_landmarks.config import stage_config
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.evaluation.explain import Situation
from mcap_landmarks.fusion.camera_view import CameraView, camera_from_info
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.inspection.camera_images import CameraImages, images_of
from mcap_landmarks.inspection.topic_roles import Choice, cameras_of, choose, chosen_before, message_type
from mcap_landmarks.lidar.scan_repair import ScanTopic
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, stage_records, told
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import M, Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.report.box_outcomes import LostBox, lost_boxes
from mcap_landmarks.report.messages_around import BESIDE_NS, MessagesAround, nearest_of, stamp_of
from mcap_landmarks.report.scan_points import scan_points, static_frames
from mcap_landmarks.stage import Channel, Config, Connection, RawMessage
from mcap_landmarks.vision.pixels import rgb_from_message

_C = TypeVar("_C", bound=Config)

_AROUND_NS = 3 * 10**9
"""How far from the asked time the bundle may be."""
_OF_BUNDLE = (SCENE_OBJECTS, MATCH, POSE, POSE_COVARIANCE, SCAN_OBJECTS, CLUSTERED_CLOUD, SCENE_VELOCITIES)
_BESIDE = (DETECTIONS, CAMERA_IMAGE, CAMERA_INFO, SCAN)


class Picture(NamedTuple):
    """What one camera saw, as far as the log tells: the pixels (H, W, 3) of its image, and what was detected in it.

    Beside a cloud there are the view of the camera and the boxes that came to nothing, too.
    """

    pixels: NDArray[np.uint8] | None = None
    detections: Detections | None = None
    view: CameraView | None = None
    lost: tuple[LostBox, ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SensorData:
    """What the sensors saw: every camera's image, and the scan as points (N, 2) in the base frame.

    Of a cloud there are the points in clusters instead, with how fast objects move.
    """

    pictures: tuple[Picture, ...] = ()
    scan_xy: Array | None = None
    cloud: ClusteredCloud | None = None
    velocities: SceneVelocities | None = None

    @property
    def views(self) -> tuple[CameraView, ...]:
        """Those of all cameras whose place the log tells."""
        return tuple(picture.view for picture in self.pictures if picture.view is not None)

    @property
    def lost(self) -> tuple[LostBox, ...] | None:
        """The boxes of all cameras that came to nothing, None where that is unknown of one."""
        told = [picture.lost for picture in self.pictures if picture.detections is not None]
        known = [lost for lost in told if lost is not None]
        return tuple(one for lost in known for one in lost) if known and len(known) == len(told) else None


def read_situation(path: Location, at_ns: int) -> tuple[Situation, SensorData]:
    """The bundle of a log that is nearest in time, and what its sensors saw.

    Raises:
        RecordingError: the log cannot be read, or has no bundle within three seconds.
    """
    with open_recording(path) as recording:
        return Situations(recording).nearest(at_ns)


class Situations:
    """The bundles of an open recording, each with what its sensors saw; what holds for all of them is read once."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        records = stage_records(recording.metadata).values()
        choice = chosen_before(recording, [record.options for record in records])
        channels = (*_OF_BUNDLE, *_BESIDE)
        self._channels = {c: channel for channel in channels for c in _connections(recording, channel, choice)}
        self._cameras = cameras_of(recording, choice).frames()
        self._images = images_of(recording, choice, _connections(recording, CAMERA_INFO, choice))
        self._first_infos = list(_first_infos(recording, self._channels))
        self._landmarks = _once(recording, MAP)
        self._frames = static_frames(recording)
        self._localize = _config(recording, LocalizeConfig, "localize")
        self._fuse = _config(recording, FuseConfig, "fuse")

    def nearest(self, at_ns: int) -> tuple[Situation, SensorData]:
        """The bundle that is nearest in time.

        Raises:
            RecordingError: there is none within three seconds.
        """
        found = self._decoded(self._raws(at_ns, _AROUND_NS))
        bundles = found.messages[MATCH] or found.messages[SCENE_OBJECTS]
        if not bundles:
            raise RecordingError(
                f"{self._recording.path}: no bundle with scene objects within 3 s of {moment(at_ns)}; the log goes "
                f"from {_span(self._recording)}, and localize writes what is explained"
            )
        stamp_ns = min((time_ns for time_ns, _ in bundles), key=lambda time_ns: abs(time_ns - at_ns))
        return self._situation(found, stamp_ns), self._view(found, stamp_ns)

    def of(self, stamp_ns: int, logged_ns: int) -> tuple[Situation, SensorData]:
        """The bundle of a stamp, whose messages were logged at a time; it may have nothing but what was detected."""
        found = self._decoded(self._needed(self._raws(logged_ns, BESIDE_NS), stamp_ns))
        return self._situation(found, stamp_ns), self._view(found, stamp_ns)

    def _raws(self, logged_ns: int, reach_ns: int) -> list[RawMessage]:
        around = self._recording.messages(self._channels, max(0, logged_ns - reach_ns), logged_ns + reach_ns)
        return [*self._first_infos, *around]

    def _needed(self, raws: Sequence[RawMessage], stamp_ns: int) -> list[RawMessage]:
        """The messages that a bundle is told from: its own, the nearest boxes of each camera, and images beside them.

        Decoding what another bundle has, and all images around, would take most of the time.
        """
        by_channel: dict[Channel[Message], list[RawMessage]] = {}
        for raw in raws:
            by_channel.setdefault(self._channels[raw.connection], []).append(raw)
        boxes = nearest_of(by_channel.pop(DETECTIONS, []), [stamp_ns])
        moments = [stamp_ns, *map(stamp_of, boxes)]
        images = [nearest_of(by_channel.pop(channel, []), moments) for channel in (CAMERA_IMAGE, CAMERA_INFO)]
        own = [raw for found in by_channel.values() for raw in found if stamp_of(raw) == stamp_ns]
        return [*boxes, *chain.from_iterable(images), *own]

    def _decoded(self, raws: Sequence[RawMessage]) -> MessagesAround:
        found = MessagesAround({channel: {} for channel in (*_OF_BUNDLE, *_BESIDE)})
        for raw in raws:
            channel = self._channels[raw.connection]
            with contextlib.suppress(MessageError, RecordingError):
                message = _read(raw, channel, self._images)
                camera = self._cameras.get(raw.connection.topic, "")
                if isinstance(message, Detections | CameraInfo):
                    camera = plain(message.frame_id)
                found.messages[channel][getattr(message, "stamp_ns", 0) or raw.log_time_ns, camera] = message
        return found

    def _situation(self, found: MessagesAround, stamp_ns: int) -> Situation:
        pose, spread = found.at(POSE, stamp_ns), found.at(POSE_COVARIANCE, stamp_ns)
        return Situation(
            stamp_ns,
            found.at(SCENE_OBJECTS, stamp_ns),
            found.at(MATCH, stamp_ns),
            self._landmarks,
            None if pose is None else pose.pose,
            None if spread is None else spread.planar_covariance,
            found.at(SCAN_OBJECTS, stamp_ns),
            tuple(found.detections(stamp_ns).values()),
            self._localize,
        )

    def _view(self, found: MessagesAround, stamp_ns: int) -> SensorData:
        pictures = _pictures(found, stamp_ns)
        scene, cloud = found.at(SCENE_OBJECTS, stamp_ns), found.at(CLUSTERED_CLOUD, stamp_ns)
        if scene is not None and cloud is not None:
            pictures = [self._beside_cloud(found, picture, scene, cloud) for picture in pictures]
            return SensorData(tuple(pictures), cloud=cloud, velocities=found.at(SCENE_VELOCITIES, stamp_ns))
        scan, seen = found.at(SCAN, stamp_ns), scene or found.at(SCAN_OBJECTS, stamp_ns)
        if scan is None or seen is None:
            return SensorData(tuple(pictures))
        return SensorData(tuple(pictures), scan_points(scan, seen.frame_id, self._frames))

    def _beside_cloud(
        self, found: MessagesAround, picture: Picture, scene: SceneObjects, cloud: ClusteredCloud
    ) -> Picture:
        """The same with the view of the camera and the boxes that came to nothing, where the log tells enough of them.

        The way that the robot makes between scan and image is left out: it matters little to a picture.
        """
        detections = picture.detections
        info = None if detections is None else found.camera_info(detections)
        if detections is None or info is None:
            return picture
        with contextlib.suppress(RecordingError):
            base_from_camera = self._frames.lookup(scene.frame_id, info.frame_id or detections.frame_id)
            camera = camera_from_info(info, rectified=self._fuse.rectified)
            view = CameraView.at(camera, base_from_camera, np.zeros(3), 0.0)
            return picture._replace(view=view, lost=lost_boxes(detections, scene, cloud, view, self._fuse))
        return picture


def _span(recording: Recording) -> str:
    return f"{moment(recording.start_ns or 0)} to {moment(recording.end_ns or 0)}"


def _read(raw: RawMessage, channel: Channel[Message], images: Mapping[Connection, CameraImages]) -> Message:
    """A message as the stages read it: scans repaired, a CameraInfo as that of its images."""
    message = decode(message_type(channel, raw.connection), raw.data, _schema(raw.connection))
    if isinstance(message, LaserScan | MultiEchoLaserScan):
        return ScanTopic().take(message)[0]
    if isinstance(message, CameraInfo) and raw.connection in images:
        return images[raw.connection].read(message)
    return message


def _first_infos(recording: Recording, channels: Mapping[Connection, Channel[Message]]) -> Iterator[RawMessage]:
    """The first CameraInfo of every camera: calibrations may come only once."""
    for connection, channel in channels.items():
        if channel == CAMERA_INFO:
            yield from islice(recording.messages([connection]), 1)


def _config(recording: Recording, config: type[_C], stage: str) -> _C:
    """What a stage ran with, as the log tells; the defaults for what it does not tell, or tells in other words."""
    given: dict[str, object] = told(recording.metadata.get(RUN, {}).get("config"), {})
    settings = given.get(stage)
    if isinstance(settings, dict):
        with contextlib.suppress(UsageError):
            return stage_config(config, stage, {k: settings[k] for k in config.__dataclass_fields__ if k in settings})
    return config()


def _schema(connection: Connection) -> str:
    return connection.schema.decode(errors="replace")


def _pictures(found: MessagesAround, stamp_ns: int) -> list[Picture]:
    """What every camera saw: those that there are images of, and then those that there are boxes of only."""
    pictures, detections = list[Picture](), found.detections(stamp_ns)
    for camera in sorted({camera for _, camera in found.messages[CAMERA_IMAGE]}):
        boxes = detections.pop(camera or next(iter(detections), ""), None)
        image = found.nearest(CAMERA_IMAGE, stamp_ns if boxes is None else boxes.stamp_ns, camera)
        pixels = None
        if isinstance(image, CompressedImage | Image):
            with contextlib.suppress(MessageError):
                pixels = rgb_from_message(image)
        pictures.append(Picture(pixels, boxes))
    return [*pictures, *(Picture(None, boxes) for boxes in detections.values())]


def _connections(recording: Recording, channel: Channel[Message], choice: Choice) -> tuple[Connection, ...]:
    """The connections that play a channel's part; none where several could, since one too many would mislead."""
    try:
        return choose(recording, channel, choice)
    except UsageError:
        return ()


def _once(recording: Recording, channel: Channel[M]) -> M | None:
    connections = recording.connections(channel.topic)
    raw = next(recording.messages(connections), None) if connections else None
    return None if raw is None else decode(channel.message, raw.data)
