"""One bundle of a log with results and all that led to it, for an explanation."""

import contextlib
import dataclasses
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import (
    CAMERA_IMAGE,
    DETECTIONS,
    MAP,
    MATCH,
    POSE,
    POSE_COVARIANCE,
    SCAN,
    SCAN_OBJECTS,
    SCENE_OBJECTS,
    TF_STATIC,
)
from mcap_landmarks.config import stage_config
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.evaluation.explain import Situation
from mcap_landmarks.geometry.frames import FrameTree, apply, rigid
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.inspection.topic_roles import Choice, cameras_of, choose, chosen_before, message_type
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, stage_records
from mcap_landmarks.messages.codec import M, Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.stage import Channel, Connection
from mcap_landmarks.vision.pixels import rgb_from_message

_AROUND_NS = 3 * 10**9
_BESIDE_NS = 10**9
"""How far from the asked time the bundle may be, and from the bundle what its sensors saw."""
_OF_BUNDLE = (SCENE_OBJECTS, MATCH, POSE, POSE_COVARIANCE, SCAN_OBJECTS)
_BESIDE = (DETECTIONS, CAMERA_IMAGE, SCAN)


class Picture(NamedTuple):
    """The pixels (H, W, 3) of an image, and what was detected in it, if the log tells."""

    pixels: NDArray[np.uint8]
    detections: Detections | None


@dataclass(frozen=True, slots=True, eq=False)
class SensorData:
    """What the sensors saw: the images of the detections, and the scan as points (N, 2) in the base frame."""

    pictures: tuple[Picture, ...] = ()
    scan_xy: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Around:
    """The messages around a moment, by channel, time and camera, which is empty where it does not matter."""

    messages: dict[Channel[Message], dict[tuple[int, str], Message]]

    def at(self, channel: Channel[M], time_ns: int) -> M | None:
        """The message of a time."""
        message = self.messages[channel].get((time_ns, ""))
        return message if isinstance(message, channel.message) else None

    def nearest(self, channel: Channel[Message], time_ns: int, camera: str) -> Message | None:
        """The message of a camera that is nearest to a time, None if it is too far away."""
        messages = self.messages[channel]
        times = [key for key in messages if key[1] == camera]
        nearest = min(times, key=lambda key: abs(key[0] - time_ns), default=None)
        return None if nearest is None or abs(nearest[0] - time_ns) > _BESIDE_NS else messages[nearest]

    def detections(self, time_ns: int) -> dict[str, Detections]:
        """The detections nearest to a time, by camera."""
        cameras = sorted({camera for _, camera in self.messages[DETECTIONS]})
        found = {camera: self.nearest(DETECTIONS, time_ns, camera) for camera in cameras}
        return {camera: message for camera, message in found.items() if isinstance(message, Detections)}


def read_situation(path: Location, at_ns: int) -> tuple[Situation, SensorData]:
    """The bundle of a log that is nearest in time, and what its sensors saw.

    Raises:
        RecordingError: the log cannot be read, or has no bundle within three seconds.
    """
    with open_recording(path) as recording:
        records = stage_records(recording.metadata).values()
        choice = chosen_before(recording, [record.options for record in records])
        channels = {c: channel for channel in (*_OF_BUNDLE, *_BESIDE) for c in _connections(recording, channel, choice)}
        found = _Around({channel: {} for channel in (*_OF_BUNDLE, *_BESIDE)})
        frames = cameras_of(recording, choice).frames()
        for raw in recording.messages(channels, at_ns - _AROUND_NS, at_ns + _AROUND_NS):
            channel = channels[raw.connection]
            with contextlib.suppress(MessageError):
                message = decode(message_type(channel, raw.connection), raw.data, _schema(raw.connection))
                camera = message.frame_id if isinstance(message, Detections) else frames.get(raw.connection.topic, "")
                found.messages[channel][getattr(message, "stamp_ns", 0) or raw.log_time_ns, camera] = message
        bundles = found.messages[MATCH] or found.messages[SCENE_OBJECTS]
        if not bundles:
            raise RecordingError(
                f"{path}: no bundle with scene objects within 3 s of {at_ns}; the log goes from {recording.start_ns} "
                f"to {recording.end_ns}, and localize writes what is explained"
            )
        stamp_ns = min((time_ns for time_ns, _ in bundles), key=lambda time_ns: abs(time_ns - at_ns))
        return _situation(recording, found, stamp_ns), _view(recording, found, stamp_ns)


def _situation(recording: Recording, found: _Around, stamp_ns: int) -> Situation:
    pose, spread = found.at(POSE, stamp_ns), found.at(POSE_COVARIANCE, stamp_ns)
    return Situation(
        stamp_ns,
        found.at(SCENE_OBJECTS, stamp_ns),
        found.at(MATCH, stamp_ns),
        _once(recording, MAP),
        None if pose is None else pose.pose,
        None if spread is None else spread.planar_covariance,
        found.at(SCAN_OBJECTS, stamp_ns),
        tuple(found.detections(stamp_ns).values()),
        _config(recording),
    )


def _config(recording: Recording) -> LocalizeConfig:
    """What localize ran with, as the log tells; the defaults for what it does not tell, or tells in other words."""
    told = json.loads(recording.metadata.get(RUN, {}).get("config", "{}")).get("localize", {})
    names = {field.name for field in dataclasses.fields(LocalizeConfig)}
    with contextlib.suppress(UsageError):
        made = stage_config(LocalizeConfig, "localize", {name: told[name] for name in names & set(told)})
        assert isinstance(made, LocalizeConfig)  # noqa: S101 - that is what was asked for
        return made
    return LocalizeConfig()


def _schema(connection: Connection) -> str:
    return connection.schema.decode(errors="replace")


def _view(recording: Recording, found: _Around, stamp_ns: int) -> SensorData:
    pictures, detections = list[Picture](), found.detections(stamp_ns)
    for camera in sorted({camera for _, camera in found.messages[CAMERA_IMAGE]}):
        boxes = detections.get(camera) if camera else next(iter(detections.values()), None)
        image = found.nearest(CAMERA_IMAGE, stamp_ns if boxes is None else boxes.stamp_ns, camera)
        if isinstance(image, CompressedImage | Image):
            with contextlib.suppress(MessageError):
                pictures.append(Picture(rgb_from_message(image), boxes))
    scene, scan = found.at(SCENE_OBJECTS, stamp_ns), found.at(SCAN, stamp_ns)
    if scan is None or scene is None:
        return SensorData(tuple(pictures))
    return SensorData(tuple(pictures), _points(recording, scan, scene.frame_id))


def _points(recording: Recording, scan: LaserScan, base: str) -> Array:
    """Where the beams ended (N, 2), in the base frame if transforms lead there, else in the scanner's own."""
    inside = np.isfinite(scan.ranges_m) & (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m <= scan.range_max_m)
    rows = np.flatnonzero(inside)
    angle, range_m = scan.angle_min_rad + rows * scan.angle_increment_rad, scan.ranges_m[rows].astype(np.float64)
    points = np.column_stack([range_m * np.cos(angle), range_m * np.sin(angle), np.zeros(len(rows))])
    edges = [
        (step.frame_id, step.child_frame_id, rigid(step.translation_m, step.rotation_xyzw))
        for connection in recording.connections(TF_STATIC.topic)
        for raw in recording.messages([connection])
        for step in decode(TF_STATIC.message, raw.data).transforms
    ]
    with contextlib.suppress(RecordingError):
        points = apply(FrameTree.of(edges).lookup(base, scan.frame_id), points)
    return points[:, :2]


def _connections(recording: Recording, channel: Channel[Message], choice: Choice) -> Iterable[Connection]:
    """The connections that play a channel's part; none where several could, since one too many would mislead."""
    try:
        return choose(recording, channel, choice)
    except UsageError:
        return ()


def _once(recording: Recording, channel: Channel[M]) -> M | None:
    connections = recording.connections(channel.topic)
    raw = next(recording.messages(connections), None) if connections else None
    return None if raw is None else decode(channel.message, raw.data)
