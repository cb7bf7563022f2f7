"""UTIAS MRCLAM data sets (Leung et al. 2011): per robot odometry, range and bearing to landmarks, and the truth."""

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import (
    BASE_FRAME,
    MAP_FRAME,
    ODOM_FRAME,
    ODOMETRY,
    SCENE_OBJECTS,
    TRUTH_OBJECTS,
    TRUTH_POSE,
)
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.messages.codec import Message, encode
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.progress import Progress
from mcap_landmarks.sources._merge import merge
from mcap_landmarks.sources._mrclam_files import DataSet, MrclamTable, file_names, keep, open_data_set
from mcap_landmarks.sources._mrclam_robot import (
    FIRST_LANDMARK,
    MrclamConfig,
    clean_odometry,
    integrate,
    odometry_covariance,
    scans,
)
from mcap_landmarks.sources._shape import OmittedTopic, Source, SourceLog
from mcap_landmarks.stage import Channel, ChannelSummary, Connection, RawMessage

_BARCODES, _LANDMARKS = "Barcodes.dat", "Landmark_Groundtruth.dat"


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """One channel of a robot: its times, and what makes the message at a place in them."""

    connection: Connection
    time_ns: NDArray[np.int64]
    message: Callable[[int], Message]
    row_bytes: float


def recognises(path: Path) -> bool:
    """A folder or zip with the barcodes and the tables of a robot."""
    if path.is_file() and path.suffix.lower() != ".zip":
        return False
    names = file_names(path)
    return _BARCODES in names or any(name.startswith("Robot") and name.endswith(".dat") for name in names)


@contextlib.contextmanager
def open_mrclam(path: Path, config: MrclamConfig) -> Iterator[Sequence[SourceLog]]:
    """One log per robot.

    Raises:
        RecordingError: the barcodes are missing, or no robot has a file.
    """
    with open_data_set(path) as data:
        pairs = data.numbers(_BARCODES, 2)
        if pairs is None or not data.robots():
            what = _BARCODES if pairs is None else "any robot's table"
            raise RecordingError(f"{path} lacks {what}; download the whole data set")
        subjects = {int(barcode): int(subject) for subject, barcode in pairs}
        yield [_robot(data, robot, subjects, config) for robot in data.robots()]


def _robot(data: DataSet, robot: int, subjects: dict[int, int], config: MrclamConfig) -> SourceLog:
    make: dict[str, Callable[[MrclamTable, str], _Track]] = {
        "Odometry": lambda table, name: _odometry(table, name, config),
        "Measurement": lambda table, name: _objects(table, name, subjects, config),
        "Groundtruth": _truth,
    }
    found: list[MrclamTable] = []
    tracks: list[_Track] = []
    notes: list[str] = []
    for content, make_track in make.items():
        name = f"Robot{robot}_{content}.dat"
        if (table := data.table(robot, content)) is None:
            notes.append(f"there is no {name}")
        else:
            found.append(table)
            tracks.append(make_track(table, name))
    if (landmarks := data.numbers(_LANDMARKS, 5)) is None:
        notes.append(f"there is no {_LANDMARKS}")
    else:
        start_ns = min((int(track.time_ns[0]) for track in tracks if len(track.time_ns)), default=0)
        tracks.insert(0, _survey(landmarks, start_ns))
    dropped: Counter[str] = sum((table.dropped for table in found), Counter())
    losses = tuple(loss for table in found for loss in table.losses)
    notes += [note for table in found for note in table.notes]
    size = sum(table.size_bytes for table in found)
    return SourceLog(f"robot{robot}", (RobotLog(tracks),), size, losses, dict(dropped), tuple(notes))


class RobotLog:
    """The log of one robot, made up from its tables."""

    losses: Sequence[str] = ()
    left_out: Sequence[OmittedTopic] = ()

    def __init__(self, tracks: list[_Track]) -> None:
        self._tracks = [track for track in tracks if len(track.time_ns)]
        self.channels = [ChannelSummary(track.connection, len(track.time_ns)) for track in self._tracks]
        self.start_ns = min((int(track.time_ns[0]) for track in self._tracks), default=None)
        self.end_ns = max((int(track.time_ns[-1]) for track in self._tracks), default=None)

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`; all definitions are ours."""

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`."""
        pieces = []
        for track in self._tracks:
            if connections is None or track.connection in connections:
                first = 0 if start_ns is None else int(np.searchsorted(track.time_ns, start_ns))
                stop = len(track.time_ns) if end_ns is None else int(np.searchsorted(track.time_ns, end_ns))
                if first < stop:
                    pieces.append((int(track.time_ns[first]), partial(_stamped, track, first, stop, progress)))
        yield from merge(pieces)


def _stamped(track: _Track, first: int, stop: int, progress: Progress | None) -> Iterator[RawMessage]:
    for i in range(first, stop):
        time_ns = int(track.time_ns[i])
        yield RawMessage(track.connection, time_ns, time_ns, i, encode(track.message(i)))
        if progress and i % 1024 == 1023:
            progress(int(1024 * track.row_bytes))


def _connection(channel: Channel[Message], *, latched: bool = False) -> Connection:
    ros_type = channel.message.ROS_TYPE
    return Connection(
        channel.topic, ros_type, definition(ros_type).encode(), metadata={KEY: qos_profile(latched=latched)}
    )


def _track(
    channel: Channel[Message], table: MrclamTable, time_ns: NDArray[np.int64], message: Callable[[int], Message]
) -> _Track:
    return _Track(_connection(channel), time_ns, message, table.size_bytes / max(len(time_ns), 1))


def _odometry(table: MrclamTable, name: str, config: MrclamConfig) -> _Track:
    clean_odometry(table, name)
    time_ns, speeds = table.time_ns, table.values
    poses = integrate(time_ns, speeds)
    covariances = odometry_covariance(time_ns, speeds, poses, config)

    def message(i: int) -> Odometry:
        forward, turn = speeds[i].tolist()
        return Odometry.planar(int(time_ns[i]), (ODOM_FRAME, BASE_FRAME), poses[i], covariances[i], (forward, turn))

    return _track(ODOMETRY, table, time_ns, message)


def _objects(table: MrclamTable, name: str, subjects: dict[int, int], config: MrclamConfig) -> _Track:
    found = scans(table, name, subjects, config)

    def message(i: int) -> SceneObjects:
        rows = slice(int(found.bounds[i]), int(found.bounds[i + 1]))
        barcodes = found.barcodes[rows].tolist()
        classes = [_landmark(subjects[code]) if code in subjects else f"barcode_{code}" for code in barcodes]
        return SceneObjects(
            int(found.time_ns[i]),
            BASE_FRAME,
            tuple(str(code) for code in barcodes),
            tuple(((class_, 1.0),) for class_ in classes),
            found.positions_xy[rows],
            found.covariances[rows],
            np.zeros(len(barcodes)),
        )

    return _track(SCENE_OBJECTS, table, found.time_ns, message)


def _truth(table: MrclamTable, name: str) -> _Track:
    new = np.append(np.ones(min(len(table.time_ns), 1), dtype=bool), np.diff(table.time_ns) > 0)
    keep(table, new, f"{name}: same time as the row before")

    def message(i: int) -> PoseStamped:
        return PoseStamped.planar(int(table.time_ns[i]), MAP_FRAME, table.values[i])

    return _track(TRUTH_POSE, table, table.time_ns, message)


def _survey(landmarks: list[list[float]], start_ns: int) -> _Track:
    """The surveyed landmarks, once, as the log begins."""
    rows = np.array([row for row in landmarks if row[0] >= FIRST_LANDMARK], dtype=np.float64).reshape(-1, 5)
    names = tuple(_landmark(int(subject)) for subject in rows[:, 0])
    covariances = np.zeros((len(rows), 2, 2))
    covariances[:, 0, 0], covariances[:, 1, 1] = rows[:, 3] ** 2, rows[:, 4] ** 2
    hypotheses = tuple(((name, 1.0),) for name in names)
    objects = SceneObjects(start_ns, MAP_FRAME, names, hypotheses, rows[:, 1:3], covariances, np.zeros(len(rows)))
    connection = _connection(TRUTH_OBJECTS, latched=True)
    return _Track(connection, np.array([start_ns], dtype=np.int64), lambda _: objects, 0.0)


def _landmark(subject: int) -> str:
    return f"landmark_{subject}"


SOURCE = Source("mrclam", "UTIAS MRCLAM data sets (folder or .zip)", MrclamConfig, recognises, open_mrclam)
