"""Which odometry and sensors of a log are compared, and how they are read."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial

from mcap_landmarks.errors import MessageError
from mcap_landmarks.inspection.clock_checks import Comparison, Sight, compare
from mcap_landmarks.inspection.log_frames import LogFrames
from mcap_landmarks.inspection.odometry_examination import ExaminedOdometry
from mcap_landmarks.inspection.open_logs import OpenLog
from mcap_landmarks.inspection.sensor_mounts import mount_of
from mcap_landmarks.inspection.turn_samples import Read, sampled
from mcap_landmarks.manifest import STAGE
from mcap_landmarks.messages.header import frame_in
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.sources import merge
from mcap_landmarks.stage import Connection, RawMessage

_SEEING = ("scan", "scene_objects")
_COMPARED = (LaserScan.ROS_TYPE, SceneObjects.ROS_TYPE)


def clocks_of(
    log: OpenLog, roles: Mapping[str, Sequence[str]], odometry: Mapping[str, ExaminedOdometry], frames: LogFrames
) -> list[Comparison]:
    """The comparisons of examined odometry, by topic, with every topic of scans and recorded scene objects."""
    if log.start_ns is None or log.end_ns is None:
        return []
    connections = [entry.connection for part in log.parts for entry in part.channels if entry.count]
    sensors = [
        (role, one) for role in _SEEING for one in _on(roles.get(role, ()), connections) if STAGE not in one.metadata
    ]
    span = log.start_ns, log.end_ns + 1
    found: list[Comparison] = []
    for topic, examined in odometry.items():
        found += clocks_between(partial(_read, log), span, (topic, examined), sensors, frames)
    return found


def _on(topics: Collection[str], connections: Iterable[Connection]) -> list[Connection]:
    return [connection for connection in connections if connection.topic in topics]


def clocks_between(
    read: Read,
    span: tuple[int, int],
    odometry: tuple[str, ExaminedOdometry],
    sensors: Iterable[tuple[str, Connection]],
    frames: LogFrames,
) -> list[Comparison]:
    """The comparisons of one topic's odometry with sensors (role, connection) that see the robot turn.

    Where a clock was set back, stamps do not tell which of them belong together, and nothing is compared. `frames` tell
    how sensors are mounted.
    """
    seeing = [(role, one) for role, one in sensors if one.message_type in _COMPARED]
    topic, examined = odometry
    if examined.track is None or examined.delay_ns is None or not seeing:
        return []
    sights = []
    for role, connection in seeing:
        mount = mount_of(_frame(read, connection, span), frames)
        if mount is not None:
            sights.append(Sight(role, connection, mount))
    return compare(read, span, topic, sampled(examined.track, examined.delay_ns), sights)


def _read(log: OpenLog, connections: Collection[Connection], start_ns: int, end_ns: int) -> Iterator[RawMessage]:
    pieces = [(part.start_ns or 0, partial(part.messages, connections, start_ns, end_ns)) for part in log.parts]
    return merge(pieces)


def _frame(read: Read, connection: Connection, span: tuple[int, int]) -> str:
    try:
        return next((frame_in(raw.data) for raw in read([connection], *span)), "")
    except MessageError:
        return ""
