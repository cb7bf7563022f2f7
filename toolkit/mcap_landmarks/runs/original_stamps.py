"""Results with the stamps of what they were made from, where the clock of those had been set back."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcap_landmarks.mapping.built_map import LogTrajectory
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.markers import MarkerArray
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.poses import Path, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.velocities import SceneVelocities

_Sensed = ScanObjects | ClusteredCloud | SceneObjects | SceneVelocities | Detections | LaserScan
_Found = MarkerArray | LandmarkMatch | PoseStamped | PoseWithCovarianceStamped | Path
_Headed = _Sensed | _Found


def as_stamped(message: Message, by_ns: int) -> Message:
    """A result with the stamp that its source had, whose clock had been set back by so much."""
    if not by_ns:
        return message
    if isinstance(message, TFMessage):
        return TFMessage(tuple(replace(step, stamp_ns=step.stamp_ns - by_ns) for step in message.transforms))
    return replace(message, stamp_ns=message.stamp_ns - by_ns) if isinstance(message, _Headed) else message


def trajectory_as_stamped(trajectory: LogTrajectory, shifts_ns: Mapping[int, int]) -> LogTrajectory:
    """A trajectory with the stamps of its bundles; by log time, how far their clock had been set back."""
    if not shifts_ns:
        return trajectory
    by_ns = np.array([shifts_ns.get(log_ns, 0) for log_ns in trajectory.log_times_ns.tolist()], dtype=np.int64)
    return replace(trajectory, stamps_ns=trajectory.stamps_ns - by_ns)
