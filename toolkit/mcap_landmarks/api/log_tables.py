"""Whole topics as tables: a row per box, object, bundle or pose."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.evaluation.pose_topics import PoseTrack
from mcap_landmarks.evaluation.trajectory import VARIANCES
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.columns import Table
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.parts import PLANAR
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.structured import StructuredArray, moments, objects

_UPPER, _UPPER_2 = np.triu_indices(3), np.triu_indices(2)
_WHEN = [("log_time_ns", "i8"), ("stamp_ns", "i8"), ("time", "M8[ns]"), ("frame_id", "O")]
_CORNERS = [(name, "f8") for name in ("x_min_px", "y_min_px", "x_max_px", "y_max_px")]
_PLACE = [(name, "f8") for name in ("x_m", "y_m", "var_x_m2", "cov_xy_m2", "var_y_m2", "radius_m")]
_IDS = [(name, "O") for name in ("object_ids", "landmark_ids", "residual_m", "failed")]
_FIGURES = [("expected_accidental", "f8"), ("chi2", "f8"), ("dof", "i8"), ("bundles_joined", "i8")]
DETECTION = np.dtype([*_WHEN, ("id", "O"), ("class", "O"), ("confidence", "f8"), *_CORNERS])
SCENE_OBJECT = np.dtype([*_WHEN, ("id", "O"), ("class", "O"), ("probability", "f8"), *_PLACE])
MATCH = np.dtype([*_WHEN, ("status", "O"), *_IDS, *_FIGURES])
"""What the rows of tables hold, see docs/api.md; an `O` is a text or a tuple."""
ODOMETRY_FIELDS = (
    "header.stamp", "header.frame_id", "child_frame_id", "pose.pose.position", "pose.pose.orientation",
    "pose.covariance", "twist.twist.linear", "twist.twist.angular",
)  # fmt: skip
"""Of `nav_msgs/msg/Odometry`, what its table is made of."""
Times = NDArray[np.int64]


def detection_table(found: Iterable[tuple[int, Detections]]) -> StructuredArray:
    """A row per box of messages with their log times."""
    rows = []
    for log_ns, message in found:
        each = zip(message.ids, message.hypotheses, message.boxes_xyxy.tolist(), strict=True)
        rows += [(*_when(log_ns, message), identity, *_best(options), *box) for identity, options, box in each]
    return StructuredArray.of_rows(DETECTION, rows)


def scene_table(found: Iterable[tuple[int, SceneObjects]]) -> StructuredArray:
    """A row per object of messages with their log times."""
    rows = []
    for log_ns, scene in found:
        numbers = np.column_stack([scene.positions_xy, scene.covariances[:, *_UPPER_2], scene.radii_m]).tolist()
        each = zip(scene.ids, scene.hypotheses, numbers, strict=True)
        rows += [(*_when(log_ns, scene), identity, *_best(options), *values) for identity, options, values in each]
    return StructuredArray.of_rows(SCENE_OBJECT, rows)


def match_table(found: Iterable[tuple[int, LandmarkMatch]]) -> StructuredArray:
    """A row per bundle of messages with their log times."""
    rows = []
    for log_ns, match in found:
        failed = tuple(one.name for one in match.conditions if not one.held)
        pairs = match.object_ids, match.landmark_ids, tuple(match.residual_m.tolist())
        figures = match.expected_accidental, match.chi2, match.dof, match.bundles_joined
        rows.append((*_when(log_ns, match), match.status.name.lower(), *pairs, failed, *figures))
    return StructuredArray.of_rows(MATCH, rows)


def _when(log_ns: int, message: Detections | SceneObjects | LandmarkMatch) -> tuple[int, int, int, str]:
    """What rows begin with: `time` is the stamp, else the log time, which is what the verbs go by."""
    return log_ns, message.stamp_ns, message.stamp_ns or log_ns, message.frame_id


def _best(options: Hypotheses) -> tuple[str, float]:
    """The most probable class, and how sure it is."""
    return options[0] if options else ("", 0.0)


def pose_table(track: PoseTrack) -> StructuredArray:
    """A row per pose of a topic, by its stamp."""
    times_ns, poses = track.trajectory.time_ns, track.trajectory.poses
    return StructuredArray.of(
        {
            "stamp_ns": times_ns,
            "time": moments(times_ns),
            "topic": objects([track.topic] * len(times_ns)),
            "frame_id": objects([track.frame] * len(times_ns)),
            **_planar(poses, track.trajectory.covariances),
        }
    )


def odometry_table(found: Iterable[tuple[int, Odometry]]) -> StructuredArray:
    """A row per message with their log times; what transforms and poses do not tell is zero."""
    pairs = list(found)
    messages = [message for _, message in pairs]
    position = np.array([message.position_m for message in messages]).reshape(-1, 3)
    orientation = np.array([message.orientation_xyzw for message in messages]).reshape(-1, 4)
    spread = np.array([message.planar_covariance for message in messages]).reshape(-1, 3, 3)
    linear = np.array([message.linear_mps for message in messages]).reshape(-1, 3)
    angular = np.array([message.angular_radps for message in messages]).reshape(-1, 3)
    return _odometry(
        np.array([log_ns for log_ns, _ in pairs], dtype=np.int64),
        np.array([message.stamp_ns for message in messages], dtype=np.int64),
        ([message.frame_id for message in messages], [message.child_frame_id for message in messages]),
        (position, orientation, spread, linear, angular),
    )


def odometry_columns(log_time_ns: Times, table: Table) -> StructuredArray:
    """The same of columns `ODOMETRY_FIELDS`."""
    stamp, frame, child, position, orientation, spread, linear, angular = (
        table.columns[name].values for name in ODOMETRY_FIELDS
    )
    planar = spread.reshape(-1, 6, 6)[:, PLANAR[0], PLANAR[1]]
    parts = (position, orientation, planar, linear, angular)
    return _odometry(log_time_ns, stamp[:, 0], (_texts(frame), _texts(child)), parts)


def by_log_time(tables: Sequence[StructuredArray]) -> StructuredArray:
    """The rows of tables of the same fields in the order of log time."""
    if len(tables) == 1:
        return tables[0]
    rows = np.concatenate([table.view(np.ndarray) for table in tables])
    return rows[np.argsort(rows["log_time_ns"], kind="stable")].view(StructuredArray)


def _odometry(
    log_ns: Times,
    stamp_ns: Times,
    frames: tuple[list[str], list[str]],
    parts: tuple[Array, Array, Array, Array, Array],
) -> StructuredArray:
    position, orientation, spread, linear, angular = parts
    return StructuredArray.of(
        {
            **_times(log_ns, stamp_ns),
            "frame_id": objects(frames[0]),
            "child_frame_id": objects(frames[1]),
            **_planar(np.column_stack([position[:, :2], yaw_from_quaternion(orientation)]), spread),
            "forward_mps": linear[:, 0],
            "left_mps": linear[:, 1],
            "turn_radps": angular[:, 2],
        }
    )


def _times(log_ns: Times | list[int], stamp_ns: Times | list[int]) -> dict[str, NDArray[np.generic]]:
    """The columns of times (N,): `time` is the stamp, else the log time, which is what the verbs go by."""
    logged, stamped = np.asarray(log_ns, dtype=np.int64), np.asarray(stamp_ns, dtype=np.int64)
    return {"log_time_ns": logged, "stamp_ns": stamped, "time": moments(np.where(stamped == 0, logged, stamped))}


def _planar(poses: Array, covariances: Array) -> dict[str, Array]:
    """The columns of poses (N, 3) with covariances (N, 3, 3)."""
    spread = covariances[:, *_UPPER]
    columns = {name: poses[:, i] for i, name in enumerate(("x_m", "y_m", "heading_rad"))}
    return columns | {name: spread[:, i] for i, name in enumerate(VARIANCES)}


def _texts(values: NDArray[np.object_]) -> list[str]:
    """Bytes (N, 1) as texts; equal ones are one object."""
    known: dict[bytes, str] = {}
    return [known.setdefault(one, one.decode(errors="replace")) for one in values[:, 0].tolist()]
