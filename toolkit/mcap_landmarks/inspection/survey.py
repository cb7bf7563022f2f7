"""One look at all sensors of a log, without running anything: times, frames, beams."""

from array import array
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import ODOMETRY
from mcap_landmarks.errors import MessageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.cameras import IMAGES
from mcap_landmarks.inspection.clock_checks import Comparison
from mcap_landmarks.inspection.log_frames import GatheredFrames, LogFrames, is_static
from mcap_landmarks.inspection.odometry_examination import OdometryMessages
from mcap_landmarks.inspection.open_logs import OpenLog
from mcap_landmarks.inspection.scan_readings import ScanReadings
from mcap_landmarks.inspection.topic_roles import message_type
from mcap_landmarks.lidar.beams import echoes
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.header import frame_in, stamp_in
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.moments import LATEST_NS
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.sources import merge
from mcap_landmarks.stage import Connection, RawMessage
from mcap_landmarks.vision.image_size import image_size

SENSORS = ("image", "camera_info", "scan", "point_cloud", "odometry", "scene_objects")
"""The roles that are looked at."""

_MOST_SCANS = 400
_CLOUDS_SPARED = 10
"""Clouds are large: of so many that would be decoded one is."""
_MOST_TRANSFORMS = 300
"""So many of a topic are decoded, spread over the log or its first: which beams and frames there are shows soon."""
_SCANS: Mapping[str, type[LaserScan] | type[MultiEchoLaserScan]] = {
    message.ROS_TYPE: message for message in (LaserScan, MultiEchoLaserScan)
}


@dataclass(slots=True)
class Sensor:
    """One topic: its role, log times and header stamps (zero where unset) of all messages, and its frame.

    `sweep_ns` is how long after its stamp a message is whole: a scan's stamp is that of its first beam.
    """

    role: str
    topic: str
    log_ns: "array[int]" = field(default_factory=lambda: array("q"))
    stamp_ns: "array[int]" = field(default_factory=lambda: array("q"))
    frame: str = ""
    sweep_ns: int = 0

    @property
    def times(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Log times and stamps (N,)."""
        return np.array(self.log_ns, dtype=np.int64), np.array(self.stamp_ns, dtype=np.int64)

    @property
    def moments(self) -> NDArray[np.int64]:
        """The times (N,) that messages are associated by, sorted: stamps, log times where those are zero."""
        log_ns, stamp_ns = self.times
        return np.sort(np.where(stamp_ns == 0, log_ns, stamp_ns))


@dataclass(slots=True)
class Returns:
    """How many of the scans that were looked at got anything back from each beam (N,), and where beams point."""

    angle_min_rad: float
    angle_increment_rad: float
    counts: NDArray[np.int64]
    scans: int = 0


@dataclass(slots=True)
class CloudSamples:
    """Of a topic's clouds that were looked at, all of them and the empty ones, and how far the points of each reach."""

    looked_at: int = 0
    empty: int = 0
    farthest_m: list[float] = field(default_factory=list)


@dataclass(slots=True)
class Survey:
    """What a log's sensors gave: the first transform of each parent and child, odometry by topic, what clocks say.

    Of each topic `infos` has the first CameraInfo with a focal length, if any, and `image_px` the size of the first
    image.
    """

    sensors: list[Sensor] = field(default_factory=list)
    transforms: GatheredFrames = field(default_factory=GatheredFrames)
    odometry: dict[str, OdometryMessages] = field(default_factory=dict)
    returns: dict[str, Returns] = field(default_factory=dict)
    clouds: dict[str, CloudSamples] = field(default_factory=dict)
    readings: dict[str, ScanReadings] = field(default_factory=dict)
    infos: dict[str, CameraInfo] = field(default_factory=dict)
    image_px: dict[str, tuple[int, int]] = field(default_factory=dict)
    unreadable: Counter[str] = field(default_factory=Counter)
    clocks: list[Comparison] = field(default_factory=list)

    def of(self, role: str) -> list[Sensor]:
        """The sensors of a role."""
        return [sensor for sensor in self.sensors if sensor.role == role]

    @property
    def edges(self) -> set[tuple[str, str]]:
        """Parent and child of each transform."""
        return {(parent, child) for child, parents in self.transforms.parents.items() for parent in parents}

    @property
    def bases(self) -> set[str]:
        """What odometry is of."""
        return {child for messages in self.odometry.values() for _, child in messages.frames[:1]}

    def log_frames(self) -> LogFrames:
        """The frames that the transforms connect."""
        return self.transforms.frames()


def survey(log: OpenLog, roles: Mapping[str, Sequence[str]], progress: Progress | None = None) -> Survey:
    """Look at a log once, at all of it: damage shows only where it is read; `roles` are topics by role."""
    found = Survey()
    sensors = {topic: Sensor(role, topic) for role in SENSORS for topic in roles.get(role, ())}
    found.sensors = list(sensors.values())
    strides = _strides(log)
    pieces = [(part.start_ns or 0, partial(part.messages, None, None, None, progress)) for part in log.parts]
    transforms = Counter[Connection]()
    for raw in merge(pieces):
        sensor = sensors.get(raw.connection.topic)
        try:
            if raw.connection.read_as == TFMessage.ROS_TYPE:
                _transforms(raw, found, transforms)
            if sensor is not None:
                _take(raw, sensor, found, strides[sensor.topic])
        except MessageError:
            found.unreadable[raw.connection.topic] += 1
    return found


def _strides(log: OpenLog) -> dict[str, int]:
    """By topic, how many messages there are for each that is decoded."""
    counts = Counter[str]()
    for part in log.parts:
        for entry in part.channels:
            counts[entry.connection.topic] += entry.count
    return {topic: max(-(-count // _MOST_SCANS), 1) for topic, count in counts.items()}


def _transforms(raw: RawMessage, found: Survey, seen: Counter[Connection]) -> None:
    seen[raw.connection] += 1
    if seen[raw.connection] <= _MOST_TRANSFORMS or is_static(raw.connection.topic):
        for step in decode(TFMessage, raw.data).transforms:
            found.transforms.take(step, is_static=is_static(raw.connection.topic))


def _take(raw: RawMessage, sensor: Sensor, found: Survey, stride: int) -> None:
    ros_type, number = raw.connection.message_type, len(sensor.log_ns)
    stamp_ns = _first_stamp_ns(raw.data) if ros_type == TFMessage.ROS_TYPE else stamp_in(raw.data)
    sensor.log_ns.append(min(raw.log_time_ns, LATEST_NS))
    sensor.stamp_ns.append(stamp_ns)
    if ros_type in _SCANS and number % stride == 0:
        scan = found.readings.setdefault(sensor.topic, ScanReadings()).read(decode(_SCANS[ros_type], raw.data))
        if scan is not None:
            _look_at_scan(scan, sensor, found.returns)
    if sensor.role == "point_cloud" and number % (stride * _CLOUDS_SPARED) == 0:
        _look_at_cloud(decode(PointCloud2, raw.data), found.clouds.setdefault(sensor.topic, CloudSamples()))
    if sensor.role == "odometry":
        odometry = odometry_from(decode(message_type(ODOMETRY, raw.connection), raw.data))
        if odometry is not None:
            found.odometry.setdefault(sensor.topic, OdometryMessages()).take(raw.log_time_ns, odometry)
    if sensor.role == "camera_info":
        _look_at_info(raw, sensor, found)
    if not number and ros_type != TFMessage.ROS_TYPE:
        _take_first(raw, sensor, found)


def _look_at_info(raw: RawMessage, sensor: Sensor, found: Survey) -> None:
    known = found.infos.get(sensor.topic)
    if known is None or not known.is_calibrated:
        found.infos[sensor.topic] = decode(CameraInfo, raw.data)


def _take_first(raw: RawMessage, sensor: Sensor, found: Survey) -> None:
    ros_type = raw.connection.message_type
    sensor.frame = plain(frame_in(raw.data))
    if ros_type in IMAGES:
        size_px = image_size(decode(IMAGES[ros_type], raw.data))
        if size_px is not None:
            found.image_px[sensor.topic] = size_px


def _first_stamp_ns(data: bytes | memoryview) -> int:
    transforms = decode(TFMessage, data).transforms
    return transforms[0].stamp_ns if transforms else 0


def _look_at_cloud(cloud: PointCloud2, seen: CloudSamples) -> None:
    points = cloud.points_m[np.isfinite(cloud.points_m).all(axis=1)]
    seen.looked_at += 1
    seen.empty += not len(points)
    if len(points):
        seen.farthest_m.append(float(np.quantile(np.linalg.norm(points, axis=1), 0.95)))


def _look_at_scan(scan: LaserScan, sensor: Sensor, returns: dict[str, Returns]) -> None:
    ranges = np.asarray(scan.ranges_m)
    seconds = max(scan.scan_time_s, scan.time_increment_s * len(ranges))
    sensor.sweep_ns = round(seconds * 1e9) if np.isfinite(seconds) else 0
    known = returns.get(sensor.topic)
    if known is None or len(known.counts) != len(ranges):  # a driver that changes its mind starts anew
        zeros = np.zeros(len(ranges), dtype=np.int64)
        known = returns[sensor.topic] = Returns(scan.angle_min_rad, scan.angle_increment_rad, zeros)
    known.counts += np.isfinite(echoes(ranges, scan.range_min_m, scan.range_max_m))
    known.scans += 1


def connected(edges: Iterable[tuple[str, str]], start: str) -> set[str]:
    """The frames that transforms lead to from one, itself included."""
    neighbours: dict[str, set[str]] = {}
    for parent, child in edges:
        neighbours.setdefault(parent, set()).add(child)
        neighbours.setdefault(child, set()).add(parent)
    reached, waiting = {start}, [start]
    while waiting:
        for name in neighbours.get(waiting.pop(), set()) - reached:
            reached.add(name)
            waiting.append(name)
    return reached
