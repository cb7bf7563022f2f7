"""A trajectory as text that other tools read: TUM, KITTI, CSV or JSON."""

import json
from collections.abc import Iterator
from enum import StrEnum

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation import tum
from mcap_landmarks.evaluation.pose_topics import PoseTrack
from mcap_landmarks.evaluation.trajectory import VARIANCES, Trajectory
from mcap_landmarks.moments import moment

SCHEMA = "mcap-landmarks/trajectory/1"
_UPPER = np.triu_indices(3)


class TrajectoryFormat(StrEnum):
    """How a trajectory is written."""

    TUM = "tum"
    KITTI = "kitti"
    CSV = "csv"
    JSON = "json"


def render(track: PoseTrack, form: TrajectoryFormat) -> tuple[str, list[str]]:
    """The text of a trajectory, and what is to be said of it.

    TUM and KITTI need the heading of every pose; those without are left out.

    Raises:
        RecordingError: no pose has a heading, and the format needs it.
    """
    if form is TrajectoryFormat.CSV:
        return _csv(track.trajectory), []
    if form is TrajectoryFormat.JSON:
        return json.dumps(_document(track), indent=1) + "\n", []
    known = np.isfinite(track.trajectory.poses[:, 2])
    if not known.any():
        raise RecordingError(f"{track.topic}: no pose has a heading, which {form} needs; use --format csv or json")
    whole = Trajectory.of(track.trajectory.time_ns[known], track.trajectory.poses[known])
    notes = [f"{(~known).sum()} poses without heading are left out; csv and json have them"] if not known.all() else []
    if form is TrajectoryFormat.TUM:
        return tum.render(whole), notes
    return _kitti(whole), [*notes, "KITTI has no times; its lines are in the order of time"]


def _kitti(trajectory: Trajectory) -> str:
    """The upper three rows of each pose's matrix in a line (Geiger et al. 2012, odometry benchmark)."""
    lines = []
    for x, y, heading in trajectory.poses.tolist():
        c, s = float(np.cos(heading)), float(np.sin(heading))
        numbers = (c, -s, 0.0, x, s, c, 0.0, y, 0.0, 0.0, 1.0, 0.0)
        lines.append(" ".join(repr(number + 0.0) for number in numbers) + "\n")
    return "".join(lines)


def _csv(trajectory: Trajectory) -> str:
    """A line per pose; what is unknown is empty."""
    lines = [f"time_ns,time,x_m,y_m,heading_rad,{','.join(VARIANCES)}\n"]
    for time_ns, pose, spread in _rows(trajectory):
        numbers = [*pose, *(spread[_UPPER].tolist() if spread is not None else [None] * 6)]
        cells = [str(time_ns), moment(time_ns), *("" if number is None else repr(number) for number in numbers)]
        lines.append(",".join(cells) + "\n")
    return "".join(lines)


def _document(track: PoseTrack) -> dict[str, object]:
    """As schemas/json/trajectory.schema.json describes it."""
    poses = [
        {
            "time_ns": time_ns,
            "time": moment(time_ns),
            "x_m": x_m,
            "y_m": y_m,
            "heading_rad": heading_rad,
            "covariance": None if spread is None else spread.tolist(),
        }
        for time_ns, (x_m, y_m, heading_rad), spread in _rows(track.trajectory)
    ]
    return {"schema": SCHEMA, "topic": track.topic, "frame": track.frame, "poses": poses}


def _rows(trajectory: Trajectory) -> Iterator[tuple[int, list[float | None], np.ndarray | None]]:
    """Time, x, y and heading, and the covariance (3, 3); None where unknown."""
    times, poses = trajectory.time_ns.tolist(), trajectory.poses.tolist()
    for time_ns, pose, spread in zip(times, poses, trajectory.covariances, strict=True):
        known = [number + 0.0 if np.isfinite(number) else None for number in pose]
        yield time_ns, known, spread if np.isfinite(spread).all() else None
