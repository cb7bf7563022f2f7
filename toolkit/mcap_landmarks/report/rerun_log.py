"""A log with results as a recording of Rerun, from file to file."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from mcap_landmarks.channels import (
    CLUSTERED_CLOUD,
    DETECTIONS,
    MAP_POSE,
    MATCH,
    POSE,
    POSE_COVARIANCE,
    SCENE_OBJECTS,
    TRUTH_DETECTIONS,
    TRUTH_POSE,
)
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.report import rerun_entities as entities
from mcap_landmarks.report.rerun_file import RerunFile, create_rerun_file
from mcap_landmarks.report.rerun_scene import (
    GREY,
    MAP,
    ODOMETRY,
    ROBOT,
    TRUTH,
    add_path,
    add_what_holds,
    blueprint,
    image_entity,
    scan_entity,
)
from mcap_landmarks.report.viewed_log import ViewedLog
from mcap_landmarks.stage import Connection
from mcap_landmarks.wording import counted

_AT_ONCE = 64
"""So many messages become rows together; memory stays small."""


@dataclass(frozen=True, slots=True)
class RerunMade:
    """The rows of every entity, and what of the log could not be read, in words."""

    rows: Mapping[str, int]
    losses: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Shown:
    """What becomes of a channel: the entities, how each is made, and the message that it is read as."""

    connection: Connection
    read_as: type[Message]
    adders: tuple[tuple[str, entities.Add], ...]


def write_rerun(path: Location, target: Path, progress: Callable[[int], None]) -> RerunMade:
    """Write a log with its results as a recording of Rerun; `progress` is told the bytes that were read.

    Raises:
        RecordingError: the log cannot be read, or has nothing to show.
    """
    result, reference, losses = read_run(path)
    with open_recording(path) as recording:
        view = ViewedLog(recording)
        way, broken = list[tuple[int, float, float, float]](), Counter[str]()
        shown = _shown(view, way)
        if not shown:
            raise RecordingError(f"{path}: has nothing that Rerun shows; name a log with images, scans or results")
        with create_rerun_file(target, recording.fingerprint(), blueprint(view)) as file:
            add_what_holds(file, view, result, reference)
            for one in shown:
                for rows in _rows(recording, one, broken, progress):
                    for entity, add in one.adders:
                        add(file, entity, rows)
            if way:
                steps = np.array([step[1:] for step in way])
                track = Trajectory.of(np.array([step[0] for step in way], np.int64), steps)
                add_path(file, f"{ODOMETRY}_path", track, GREY)
            file.name_classes()
            told = [f"{topic}: {counted(count, 'message')} cannot be decoded" for topic, count in broken.items()]
            lost = dict.fromkeys([*losses, *recording.losses, *told])
            return RerunMade(dict(sorted(file.rows.items())), tuple(lost))


def _shown(view: ViewedLog, way: list[tuple[int, float, float, float]]) -> list[_Shown]:
    """Every channel that is shown, and where; `way` gets the steps of odometry."""
    found = list[_Shown]()

    def show(connection: Connection | None, read_as: type[Message], *adders: tuple[str, entities.Add]) -> None:
        if connection is not None and connection.read_as == read_as.ROS_TYPE:
            found.append(_Shown(connection, read_as, adders))

    for number, camera in enumerate(view.cameras):
        for kind in (CompressedImage, Image):
            show(camera.image, kind, (image_entity(view, number), entities.add_images))
    for channel, name in ((DETECTIONS, "detections"), (TRUTH_DETECTIONS, "truth")):
        if view.cameras:
            show(view.on(channel.topic), channel.message, (name, _over_images(view)))
    for scan in view.scans:
        for of_scans in (LaserScan, MultiEchoLaserScan, PointCloud2):
            show(scan, of_scans, (scan_entity(view, scan), entities.add_points))
    cloud, scene = view.on(CLUSTERED_CLOUD.topic), view.on(SCENE_OBJECTS.topic)
    show(cloud, CLUSTERED_CLOUD.message, (f"{ROBOT}/clustered_cloud", entities.add_points))
    show(scene, SCENE_OBJECTS.message, (f"{ROBOT}/objects", entities.add_objects))
    show(view.on(MATCH.topic), MATCH.message, ("status", entities.add_status))
    estimate = POSE if view.on(POSE.topic) is not None else MAP_POSE
    for poses, entity, name in ((estimate, ROBOT, "estimate"), (TRUTH_POSE, TRUTH, "truth")):
        adders = (entity, entities.add_pose), (f"position/{name}", entities.add_position)
        show(view.on(poses.topic), poses.message, *adders)
    spread = (f"{MAP}/pose_covariance", entities.add_covariance), ("sigma", entities.add_sigma)
    show(view.on(POSE_COVARIANCE.topic), POSE_COVARIANCE.message, *spread)
    for connection in view.odometry:
        show(connection, Odometry, (ODOMETRY, _along(way)))
    return found


def _rows(
    recording: Recording, shown: _Shown, broken: Counter[str], progress: Callable[[int], None]
) -> Iterator[entities.Messages]:
    """The messages of a channel, many at a time; those that cannot be decoded are counted."""
    raws = recording.messages([shown.connection], progress=progress)
    while part := [*islice(raws, _AT_ONCE)]:
        log_ns, stamps_ns, messages = list[int](), list[int](), list[Message]()
        for raw in part:
            try:
                message = decode(shown.read_as, raw.data)
                if isinstance(message, CompressedImage | Image):
                    entities.encodable(message)
            except MessageError:
                broken[shown.connection.topic] += 1
                continue
            scan = message.nearest if isinstance(message, MultiEchoLaserScan) else message
            log_ns.append(raw.log_time_ns)
            stamps_ns.append(getattr(scan, "stamp_ns", 0) or raw.log_time_ns)
            messages.append(message)
        if messages:
            yield entities.Messages(log_ns, stamps_ns, messages)


def _over_images(view: ViewedLog) -> entities.Add:
    """Boxes go over the image of the camera in whose frame they are; the first one's where none is."""
    by_frame = {view.frame(camera.info or camera.image): number for number, camera in enumerate(view.cameras)}

    def add(file: RerunFile, entity: str, rows: entities.Messages) -> None:
        parts: dict[int, list[int]] = {}
        for row, message in enumerate(rows.messages):
            frame = message.frame_id if isinstance(message, Detections) else ""
            parts.setdefault(by_frame.get(plain(frame), 0), []).append(row)
        for number, chosen in parts.items():
            entities.add_boxes(file, f"{image_entity(view, number)}/{entity}", rows.some(chosen))

    return add


def _along(steps: list[tuple[int, float, float, float]]) -> entities.Add:
    """Poses, and what they are as a path."""

    def add(file: RerunFile, entity: str, rows: entities.Messages) -> None:
        entities.add_pose(file, entity, rows)
        for stamp_ns, message in zip(rows.stamps_ns, rows.messages, strict=True):
            if isinstance(message, Odometry):
                steps.append((stamp_ns, *message.pose.tolist()))

    return add
