"""What always holds of a log in Rerun: map, paths and sensors, where entities are, and how they are shown."""

import contextlib
from itertools import islice

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mcap_landmarks.channels import MATCH, POSE_COVARIANCE
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.evaluation.metrics import Reference, RunResult
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.geometry.frames import FrameTree
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.rerun_entities import ellipses
from mcap_landmarks.report.rerun_file import LOG_TIME, RerunFile, level, transform
from mcap_landmarks.report.scan_points import static_frames
from mcap_landmarks.report.viewed_log import ViewedCamera, ViewedLog
from mcap_landmarks.stage import Connection

MAP, ROBOT, TRUTH, ODOMETRY = "map", "map/robot", "map/truth", "odom/robot"
_FEW = 100
"""So many CameraInfos are asked for a focal length."""
_PAUSE_NS = 2 * 10**9
"""Poses farther apart are not joined by a line."""
_LEAST_M = 0.05
"""Landmarks without a radius are drawn with this one."""
_ESTIMATE, _TRUE, GREY = (213, 94, 0), (0, 114, 178), (156, 163, 175)


def add_what_holds(file: RerunFile, view: ViewedLog, result: RunResult, reference: Reference) -> None:
    """The map, whole paths, and where sensors are on the robot."""
    file.always(MAP, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _add_landmarks(file, result.drawn if result.landmarks is None else result.landmarks)
    paths = (f"{MAP}/path", result.trajectory, _ESTIMATE), (f"{MAP}/true_path", reference.trajectory, _TRUE)
    for entity, track, colour in paths:
        if track is not None:
            add_path(file, entity, track, colour)
    for entity, colour in ((ROBOT, _ESTIMATE), (TRUTH, _TRUE)):
        file.always(entity, rr.Arrows3D(vectors=[[0.6, 0.0, 0.0]], colors=colour))
    frames, base = static_frames(view.recording), view.base_frame
    for scan in view.scans:
        _place(file, sensor_entity(view, scan), frames, base, view.frame(scan))
    for number, camera in enumerate(view.cameras):
        _add_camera(file, view, camera, number)
        _place(file, _camera(view, number), frames, base, view.frame(camera.info or camera.image))


def _add_landmarks(file: RerunFile, landmarks: SceneObjects | None) -> None:
    """The map: points of the landmarks' sizes, and below them the 95 % regions of their places."""
    if landmarks is None or not len(landmarks):
        return
    ids, names = file.class_ids(landmarks.classes), [name or "?" for name in landmarks.classes]
    radii, places = np.maximum(landmarks.radii_m, _LEAST_M), level(landmarks.positions_xy)
    file.always(f"{MAP}/landmarks", rr.Points3D(places, class_ids=ids, labels=names, radii=radii))
    regions = ellipses(landmarks.positions_xy, landmarks.covariances)
    if regions:
        file.always(f"{MAP}/landmarks/uncertainty", rr.LineStrips3D(regions, colors=GREY))


def add_path(file: RerunFile, entity: str, track: Trajectory, colour: tuple[int, int, int]) -> None:
    """A whole path, parted where it pauses."""
    after = np.flatnonzero(np.diff(track.time_ns) > _PAUSE_NS) + 1
    pieces = [level(piece) for piece in np.split(track.poses[:, :2], after) if len(piece) > 1]
    if pieces:
        file.always(entity, rr.LineStrips3D(pieces, colors=colour))


def _place(file: RerunFile, entity: str, frames: FrameTree, base: str, frame: str) -> None:
    """Where a sensor is on the robot, if transforms tell."""
    with contextlib.suppress(RecordingError):
        file.always(entity, transform(frames.lookup(base, frame)))


def _add_camera(file: RerunFile, view: ViewedLog, camera: ViewedCamera, number: int) -> None:
    """How a camera projects, by the first of its CameraInfos that tells."""
    for raw in islice(view.recording.messages([camera.info]), _FEW) if camera.info is not None else ():
        with contextlib.suppress(MessageError):
            info = decode(CameraInfo, raw.data)
            if info.intrinsics[0, 0] > 0:
                size = [info.width_px, info.height_px]
                pinhole = rr.Pinhole(image_from_camera=info.intrinsics, resolution=size, image_plane_distance=0.5)
                file.always(_camera(view, number), pinhole)
                return


def sensor_entity(view: ViewedLog, scan: Connection) -> str:
    """The entity of the frame that scans are in."""
    return f"{ROBOT}/{_name(view.frame(scan) or view.base_frame)}"


def scan_entity(view: ViewedLog, scan: Connection) -> str:
    """The entity of scans or clouds."""
    return f"{sensor_entity(view, scan)}/{_name(scan.topic)}"


def _camera(view: ViewedLog, number: int) -> str:
    """The entity of a camera."""
    camera = view.cameras[number]
    return f"{ROBOT}/{_name(view.frame(camera.info or camera.image) or f'camera {number}')}"


def image_entity(view: ViewedLog, number: int) -> str:
    """The entity of a camera's images."""
    return f"{_camera(view, number)}/image"


def _name(text: str) -> str:
    """A frame or topic as one part of an entity's path."""
    return rr.escape_entity_path_part(text.strip("/"))


def blueprint(view: ViewedLog) -> rrb.Blueprint:
    """Images and the status beside the map, and below it what can be plotted."""
    left: list[rrb.View] = [
        rrb.Spatial2DView(origin=f"/{_camera(view, number)}", name=camera.image.topic)
        for number, camera in enumerate(view.cameras)
    ]
    plots: list[rrb.View] = []
    if view.on(MATCH.topic) is not None:
        left.append(rrb.TextLogView(origin="/status", name="Status"))
        plots.append(rrb.TimeSeriesView(origin="/status", name="Status (0: localized)"))
    plots.append(rrb.TimeSeriesView(origin="/position", name="Position [m]"))
    if view.on(POSE_COVARIANCE.topic) is not None:
        plots.append(rrb.TimeSeriesView(origin="/sigma", name="Standard deviation [m]"))
    spaces: list[rrb.View] = [rrb.Spatial3DView(origin=f"/{MAP}", name="Map")]
    if view.odometry:
        spaces.append(rrb.Spatial3DView(origin=f"/{ODOMETRY.partition('/')[0]}", name="Odometry"))
    scene = rrb.Vertical(rrb.Tabs(*spaces), rrb.Horizontal(*plots), row_shares=[3, 1])
    whole = rrb.Horizontal(rrb.Vertical(*left), scene, column_shares=[2, 3]) if left else scene
    return rrb.Blueprint(whole, rrb.TimePanel(timeline=LOG_TIME), collapse_panels=True)
