"""What messages become in Rerun: typed entities, many messages at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import rerun as rr

from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.drawing import regions_95
from mcap_landmarks.report.rerun_file import RerunFile, level
from mcap_landmarks.report.scan_points import own_points
from mcap_landmarks.vision.pixels import rgb_from_message

_JPEG_START, _PNG_START = b"\xff\xd8", b"\x89PNG"
_CORNERS = 32
"""Points on the outline of an ellipse."""


@dataclass(frozen=True, slots=True, eq=False)
class Messages:
    """Messages of one channel, with their log times and stamps."""

    log_ns: Sequence[int]
    stamps_ns: Sequence[int]
    messages: Sequence[Message]

    def some(self, chosen: Sequence[int]) -> "Messages":
        """Those with some numbers."""
        log_ns, stamps_ns = ([values[row] for row in chosen] for values in (self.log_ns, self.stamps_ns))
        return Messages(log_ns, stamps_ns, [self.messages[row] for row in chosen])


Add = Callable[[RerunFile, str, Messages], None]
"""Adds messages to an entity, and to those below it."""


def add_images(file: RerunFile, entity: str, rows: Messages) -> None:
    """JPEG and PNG as they are, every other image as JPEG."""
    blobs = [_encoded(message) for message in rows.messages if isinstance(message, CompressedImage | Image)]
    kinds = ["image/png" if blob.startswith(_PNG_START) else "image/jpeg" for blob in blobs]
    file.add(entity, rows.log_ns, rows.stamps_ns, rr.EncodedImage.columns(blob=blobs, media_type=kinds))


def encodable(message: Message) -> bool:
    """Whether an image is one that can be shown.

    Raises:
        MessageError: it is not.
    """
    return isinstance(message, CompressedImage | Image) and bool(_encoded(message))


def _encoded(message: CompressedImage | Image) -> bytes:
    if isinstance(message, CompressedImage) and message.data[:4].startswith((_JPEG_START, _PNG_START)):
        return bytes(message.data)
    rgb = rgb_from_message(message)
    return bytes(cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1].tobytes())


def add_boxes(file: RerunFile, entity: str, rows: Messages) -> None:
    """Boxes in pixels, with class and score."""
    found = [message for message in rows.messages if isinstance(message, Detections)]
    boxes = np.vstack([np.zeros((0, 4)), *(one.boxes_xyxy for one in found)])
    best = [options[0] if options else ("", 0.0) for one in found for options in one.hypotheses]
    columns = rr.Boxes2D.columns(
        centers=(boxes[:, :2] + boxes[:, 2:]) / 2,
        half_sizes=(boxes[:, 2:] - boxes[:, :2]) / 2,
        class_ids=file.class_ids(name for name, _ in best),
        labels=[f"{name} {score:.2f}" for name, score in best],
    )
    file.add(entity, rows.log_ns, rows.stamps_ns, columns.partition([len(one) for one in found]))


def add_points(file: RerunFile, entity: str, rows: Messages) -> None:
    """Scans and clouds, in the frames of their sensors; the points of clusters in a colour for each."""
    points, colours = zip(*map(_points, rows.messages), strict=True)
    columns = rr.Points3D.columns(positions=np.vstack(points), colors=np.vstack(colours))
    file.add(entity, rows.log_ns, rows.stamps_ns, columns.partition([len(one) for one in points]))


def _points(message: Message) -> tuple[Array, np.ndarray]:
    if isinstance(message, ClusteredCloud):
        hues = (message.clusters * 37 % 180).astype(np.uint8)  # neighbours in number far apart in hue
        full = np.full(len(hues), 255, np.uint8)
        coloured = cv2.cvtColor(np.stack([hues, full // 4 * 3, full], axis=1)[None], cv2.COLOR_HSV2RGB)[0]
        return message.points_m.astype(np.float64), coloured.reshape(-1, 3)
    if isinstance(message, PointCloud2):
        found = message.points_m[np.isfinite(message.points_m).all(axis=1)].astype(np.float64)
    else:
        scan = message.nearest if isinstance(message, MultiEchoLaserScan) else message
        found = own_points(scan)[0] if isinstance(scan, LaserScan) else np.zeros((0, 3))
    return found, np.tile(np.array([[250, 204, 21]], np.uint8), (len(found), 1))


def add_objects(file: RerunFile, entity: str, rows: Messages) -> None:
    """Objects with their classes, and below them the 95 % regions of their places."""
    scenes = [message for message in rows.messages if isinstance(message, SceneObjects)]
    names = [name for scene in scenes for name in scene.classes]
    columns = rr.Points3D.columns(
        positions=np.vstack([np.zeros((0, 3)), *(level(scene.positions_xy) for scene in scenes)]),
        class_ids=file.class_ids(names),
        labels=[name or "?" for name in names],
        radii=np.concatenate([np.zeros(0), *(np.maximum(scene.radii_m, 0.05) for scene in scenes)]),
    )
    file.add(entity, rows.log_ns, rows.stamps_ns, columns.partition([len(scene) for scene in scenes]))
    regions = [ellipses(scene.positions_xy, scene.covariances) for scene in scenes]
    _add_lines(file, f"{entity}/uncertainty", rows, regions)


def add_pose(file: RerunFile, entity: str, rows: Messages) -> None:
    """Where something is, as a transform that moves what is below it."""
    found = [one for one in rows.messages if isinstance(one, PoseStamped | PoseWithCovarianceStamped | Odometry)]
    turns = np.array([one.orientation_xyzw if one.orientation_xyzw.any() else [0, 0, 0, 1] for one in found])
    columns = rr.Transform3D.columns(translation=np.array([one.position_m for one in found]), quaternion=turns)
    file.add(entity, rows.log_ns, rows.stamps_ns, columns)


def add_position(file: RerunFile, entity: str, rows: Messages) -> None:
    """x and y over time."""
    found = [one for one in rows.messages if isinstance(one, PoseStamped)]
    for i, axis in enumerate("xy"):
        columns = rr.Scalars.columns(scalars=[one.position_m[i] for one in found])
        file.add(f"{entity}/{axis}", rows.log_ns, rows.stamps_ns, columns)


def add_covariance(file: RerunFile, entity: str, rows: Messages) -> None:
    """The 95 % region of every position."""
    found = [one for one in rows.messages if isinstance(one, PoseWithCovarianceStamped)]
    places = [(one.position_m[None, :2], one.planar_covariance[None, :2, :2]) for one in found]
    _add_lines(file, entity, rows, [ellipses(*place) for place in places])


def add_sigma(file: RerunFile, entity: str, rows: Messages) -> None:
    """The standard deviations of x and y over time."""
    found = [one for one in rows.messages if isinstance(one, PoseWithCovarianceStamped)]
    for i, axis in enumerate("xy"):
        sigmas_m = [float(np.sqrt(max(one.planar_covariance[i, i], 0.0))) for one in found]
        file.add(f"{entity}/{axis}", rows.log_ns, rows.stamps_ns, rr.Scalars.columns(scalars=sigmas_m))


def add_status(file: RerunFile, entity: str, rows: Messages) -> None:
    """The status of every bundle as a number, and in words with the matched landmarks."""
    found = [one for one in rows.messages if isinstance(one, LandmarkMatch)]
    numbers = rr.Scalars.columns(scalars=[int(one.status) for one in found])
    file.add(f"{entity}/code", rows.log_ns, rows.stamps_ns, numbers)
    words = [one.status.name.lower().replace("_", " ") for one in found]
    texts = [f"{word}: {', '.join(one.landmark_ids)}" for word, one in zip(words, found, strict=True)]
    levels = ["INFO" if one.status is Status.LOCALIZED else "WARN" for one in found]
    file.add(f"{entity}/text", rows.log_ns, rows.stamps_ns, rr.TextLog.columns(text=texts, level=levels))


def _add_lines(file: RerunFile, entity: str, rows: Messages, lines: Sequence[list[Array]]) -> None:
    columns = rr.LineStrips3D.columns(strips=[line for found in lines for line in found])
    file.add(entity, rows.log_ns, rows.stamps_ns, columns.partition([len(found) for found in lines]))


def ellipses(places_xy: Array, covariances: Array) -> list[Array]:
    """The outlines (M, 3) of 95 % regions, where covariances (N, 2, 2) are known."""
    known = np.isfinite(covariances).all(axis=(1, 2)) & covariances.any(axis=(1, 2))
    radii, directions = regions_95(covariances[known])
    angle = np.linspace(0, 2 * np.pi, _CORNERS + 1)
    rings = radii[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    poses = np.column_stack([places_xy[known], directions])
    return [level(transform_points(pose, ring)) for pose, ring in zip(poses, rings, strict=True)]
