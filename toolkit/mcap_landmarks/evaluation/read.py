"""What is evaluated, from files: recordings with results, landmark databases, Appendix D's text, TUM trajectories."""

import numpy as np

from mcap_landmarks.channels import (
    MAP,
    MAP_MARKERS,
    MAP_POSE,
    MATCH,
    NO_SCENES,
    POSE,
    POSE_COVARIANCE,
    SCENE_OBJECTS,
    TRUTH_OBJECTS,
    TRUTH_POSE,
)
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation import tum
from mcap_landmarks.evaluation.collected import COLUMNAR, ONCE, Collected
from mcap_landmarks.evaluation.metrics import NOWHERE, Reference, RunResult
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.locations import Location, open_to_read
from mcap_landmarks.maps.database import read_map
from mcap_landmarks.maps.exchange import read_text
from mcap_landmarks.maps.exchange_thesis import parse_results
from mcap_landmarks.maps.map_message import scene_from_map
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.header import SHORTEST, stamp_in
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import definition_in
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.clocks import Clock, clock_of, shifts_of
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.stage import Channel, Connection
from mcap_landmarks.wording import counted

_RESULTS = (SCENE_OBJECTS, MATCH, POSE, POSE_COVARIANCE, MAP, MAP_MARKERS, MAP_POSE)
_TRUTH = (TRUTH_POSE, TRUTH_OBJECTS)
_AT_ONCE = 2000
"""So many messages become columns together; memory stays small."""


def read_run(path: Location, progress: Progress | None = None) -> tuple[RunResult, Reference, list[str]]:
    """What a file holds to evaluate, its own reference, and what of it could not be read.

    The file is a recording with results, a landmark database, or (.txt) results as in the thesis's Appendix D.

    Raises:
        ToolkitError: it is none of these.
    """
    if path.suffix == ".txt":
        return *_appendix_d(path), []
    if is_database(path):
        return RunResult(NOWHERE, 0, landmarks=scene_from_map(read_map(path), 0)), Reference(), []
    found = _collect(path, (*_RESULTS, *_TRUTH), progress)
    return found.result(), found.reference(), found.losses


def read_reference(path: Location, progress: Progress | None = None) -> tuple[Reference, list[str]]:
    """The truth in a file, a TUM trajectory (.tum, .txt) or a recording, and what of it could not be read.

    Raises:
        RecordingError: it is neither, or holds no truth.
    """
    if path.suffix in {".tum", ".txt"}:
        return Reference(tum.parse(read_text(path), str(path))), []
    found = _collect(path, _TRUTH, progress)
    reference = found.reference()
    if reference.trajectory is None and reference.objects is None:
        raise RecordingError(f"{path}: has neither {TRUTH_POSE.topic} nor {TRUTH_OBJECTS.topic}; name a log with truth")
    return reference, found.losses


def _appendix_d(path: Location) -> tuple[RunResult, Reference]:
    results = parse_results(read_text(path), str(path))
    count = len(results.classes)
    unknown = np.full((count, 1), np.nan)  # the thesis estimates no heading
    rows = np.arange(count) * 10**10  # apart in time, since each position stands alone
    eligible = sum(len(classes) >= 2 for classes in results.classes)
    estimate = Trajectory.of(rows, np.hstack([results.estimate_xy, unknown]))
    return RunResult(estimate, count, eligible), Reference(
        Trajectory.of(rows, np.hstack([results.reference_xy, unknown]))
    )


def is_database(path: Location) -> bool:
    """Whether a file is, or by its name should be, a landmark database."""
    try:
        with open_to_read(path) as stream:
            return path.suffix == ".db" or stream.read(15) == b"SQLite format 3"
    except OSError:
        return path.suffix == ".db"  # opening it says what is wrong


def _collect(path: Location, channels: tuple[Channel[Message], ...], progress: Progress | None) -> Collected:
    with open_recording(path) as recording:
        found = Collected(str(path), clock=_clock(recording))
        connections = _connections(recording, channels)
        _add_columns(recording, connections, found)
        held: dict[tuple[Channel[Message], bytes], tuple[list[int], list[bytes]]] = {}
        for raw in recording.messages(connections, progress=progress):
            channel = connections[raw.connection]
            if channel.topic in found.once:
                continue
            logged_ns, messages = held.setdefault((channel, raw.connection.schema), ([], []))
            logged_ns.append(raw.log_time_ns)
            messages.append(bytes(raw.data))
            if len(messages) == _AT_ONCE or channel in ONCE:
                found.add(channel, _text(raw.connection.schema), *held.pop((channel, raw.connection.schema)))
        for (channel, schema), rest in held.items():
            found.add(channel, _text(schema), *rest)
        broken = (f"{topic}: {counted(count, 'message')} could not be decoded" for topic, count in found.broken.items())
        found.losses.extend([*broken, *recording.losses])
    return found


def _add_columns(recording: Recording, connections: dict[Connection, Channel[Message]], found: Collected) -> None:
    """Collect the channels whose columns can be gathered at once, and take them out of the connections."""
    for connection, channel in list(connections.items()):
        if channel.message in COLUMNAR:
            ros_type = channel.message.ROS_TYPE
            layout = layout_of(ros_type, definition_in(ros_type, _text(connection.schema)))
            rows = recording.columns(connection, layout)
            if rows.table.rows or rows.broken:
                found.add_table(channel, rows.log_time_ns, rows.table, rows.broken)
            del connections[connection]


def _clock(recording: Recording) -> Clock:
    """The clock that stamped the log, by whichever of its channels says most often when it was."""
    for channel in (TRUTH_POSE, MATCH, POSE, MAP_POSE):
        connections = recording.connections(channel.topic)
        raws = recording.messages(connections) if connections else ()
        pairs = [(raw.log_time_ns, stamp_in(raw.data)) for raw in raws if len(raw.data) >= SHORTEST]
        if pairs:
            log_ns, stamp_ns = np.array(pairs, dtype=np.int64).T
            return clock_of(log_ns, stamp_ns, *shifts_of(log_ns, stamp_ns))
    return Clock()


def _text(schema: bytes) -> str:
    return schema.decode(errors="replace")


def _connections(recording: Recording, channels: tuple[Channel[Message], ...]) -> dict[Connection, Channel[Message]]:
    connections = {connection: channel for channel in channels for connection in recording.connections(channel.topic)}
    for connection, channel in connections.items():
        needed = channel.message.ROS_TYPE
        if connection.message_type != needed:
            raise RecordingError(
                f"{recording.path}: {channel.topic} is {connection.message_type} instead of {needed}; "
                "rename that topic, or name the truth with --reference"
            )
    if SCENE_OBJECTS in channels and not recording.connections(SCENE_OBJECTS.topic):
        connections.update(_foreign_scenes(recording))
    return connections


def _foreign_scenes(recording: Recording) -> dict[Connection, Channel[Message]]:
    """The one topic of scene objects that somebody else wrote, if there is one."""
    found = [entry.connection for entry in recording.channels if entry.connection.read_as == SceneObjects.ROS_TYPE]
    foreign = [connection for connection in found if connection.topic not in NO_SCENES]
    return {foreign[0]: SCENE_OBJECTS} if len(foreign) == 1 else {}
