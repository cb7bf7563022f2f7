"""Odometry tracks of a few messages."""

from collections.abc import Sequence

import numpy as np
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.odometry_track import OdometryTrack


def track(steps: Sequence[tuple[int, Odometry]], piece: Sequence[int] = ()) -> OdometryTrack:
    """The track of odometry at times, in pieces; of one piece where none are given."""
    count = len(steps)
    return OdometryTrack(
        "odom",
        np.array([at for at, _ in steps], dtype=np.int64),
        np.array([step.pose for _, step in steps]).reshape(-1, 3),
        np.array([step.planar_covariance for _, step in steps]).reshape(-1, 3, 3),
        np.array(piece or [0] * count, dtype=np.int64),
        np.zeros((count, 2)),
    )
