"""One log's observations to landmarks, in its odometry's frame: what is seen again gets the same number."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry.se2 import Array, between, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.data_association import UNLABELLED, Labels, label_observations
from mcap_landmarks.mapping.observations import LogObservations

# Odometry this many times better or worse than configured is tried; the observations tell which it is. Within the range
# the sigma of one of them is right to a factor of 1.4, squared distances to 2, less than lies between the two gates.
_SCALES = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, slots=True, eq=False)
class Submap:
    """What one log saw, in its odometry's frame: landmark (N,) of each of its N observations, `UNLABELLED` if unclear.

    Of L landmarks: class_ids (L,), positions_xy (L, 2), first guesses. poses (T, 3) of the bundles.
    """

    landmark: NDArray[np.int64]
    class_ids: NDArray[np.int64]
    positions_xy: Array
    poses: Array


def motions_of(log: LogObservations) -> Motions:
    """The log's motions between its bundles."""
    poses = log.odom_from_base
    return Motions(between(poses[:-1], poses[1:]), np.diff(log.way_m), np.diff(log.turned_rad))


def build_submap(log: LogObservations, class_ids: NDArray[np.int64], config: BuildMapConfig) -> Submap:
    """Label a log's observations, of classes with the ids class_ids (N,), and place its landmarks roughly.

    Tried at several scales of the odometry noise; the scale of the highest evidence wins (MacKay 1992). `slack` widens
    the observations' sigmas: sensors err more than they say, and a gate that is too tight splits landmarks in two.
    """
    motions, noise = motions_of(log), config.odometry
    widened = log.covariances * config.slack**2
    best: Labels | None = None
    for scale in _SCALES:
        scaled = OdometryNoise(
            noise.position_per_metre_m * scale,
            noise.heading_per_metre_rad * scale,
            noise.heading_per_radian_rad * scale,
        )
        steps = motion_covariance(motions, scaled)
        labels = label_observations(log.odom_from_base, steps, log.bundle, class_ids, log.points_xy, widened)
        if best is None or labels.log_evidence > best.log_evidence:
            best = labels
    assert best is not None  # noqa: S101 - there is at least one scale
    return _submap(log, class_ids, best)


def _submap(log: LogObservations, class_ids: NDArray[np.int64], labels: Labels) -> Submap:
    seen = np.flatnonzero(labels.landmark != UNLABELLED)
    numbers, first = np.unique(labels.landmark[seen], return_index=True)
    landmark = np.full(len(labels.landmark), UNLABELLED, dtype=np.int64)
    landmark[seen] = np.searchsorted(numbers, labels.landmark[seen])
    points = transform_points(labels.poses[log.bundle[seen]], log.points_xy[seen])
    positions = np.array([np.median(points[landmark[seen] == i], axis=0) for i in range(len(numbers))]).reshape(-1, 2)
    return Submap(landmark, class_ids[seen[first]], positions, labels.poses)
