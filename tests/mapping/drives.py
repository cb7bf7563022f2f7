"""Made-up drives past landmarks, with drifting odometry and noisy observations whose landmarks are known."""

from dataclasses import dataclass, replace

import numpy as np
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, dead_reckoning, motion_covariance
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.log_graph import LandmarkObservations
from mcap_landmarks.mapping.observations import LogObservations
from numpy.typing import NDArray

Array = NDArray[np.float64]
SMALL_ROBOT = OdometryNoise(0.02, 0.009, 0.02)


@dataclass(frozen=True, slots=True)
class Drive:
    """A log as the graph takes it, and the truth: poses (N, 3) and all landmarks (L, 2) in the world."""

    log: LandmarkObservations
    poses: Array
    landmarks_xy: Array


def landmarks_beside(radius_m: float, count: int, seed: int) -> Array:
    """Landmarks (count, 2) up to 4 m off a circle around the origin."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    radius = radius_m + rng.choice([-1, 1], count) * rng.uniform(1.5, 4, count)
    return np.asarray(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def drive(
    landmarks_xy: Array,
    radius_m: float,
    seed: int,
    *,
    laps: float = 1.2,
    start_rad: float = 0.0,
    step_m: float = 0.25,
    odometry: OdometryNoise = SMALL_ROBOT,
    sigma_range_m: float = 0.03,
    sigma_bearing_rad: float = 0.01,
) -> Drive:
    """A robot on a circle that sees landmarks up to 8 m ahead and aside; its odometry starts at zero."""
    rng = np.random.default_rng(seed)
    angle = start_rad + np.arange(0, laps * 2 * np.pi, step_m / radius_m)
    poses = np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), angle + np.pi / 2], axis=-1)
    true = se2.between(poses[:-1], poses[1:])
    way, turn = np.full(len(true), step_m), np.full(len(true), step_m / radius_m)
    root = np.linalg.cholesky(motion_covariance(Motions(true, way, turn), odometry))
    motions = Motions(true + (root @ rng.normal(size=(len(true), 3, 1)))[..., 0], way, turn)
    local = se2.transform_points(se2.inverse(poses)[:, None], landmarks_xy)
    distance, bearing = np.hypot(local[..., 0], local[..., 1]), np.arctan2(local[..., 1], local[..., 0])
    pose, landmark = np.nonzero((distance < 8) & (np.abs(bearing) < 1.2))
    range_m = distance[pose, landmark] + rng.normal(0, sigma_range_m, len(pose))
    bearing_rad = bearing[pose, landmark] + rng.normal(0, sigma_bearing_rad, len(pose))
    covariance = np.tile(np.diag([sigma_range_m**2, sigma_bearing_rad**2]), (len(pose), 1, 1))
    log = LandmarkObservations(np.zeros(3), motions, pose, landmark, range_m, bearing_rad, covariance)
    return Drive(log, poses, landmarks_xy)


def with_wrong_landmarks(given: Drive, share: float, seed: int) -> Drive:
    """The same drive with a share of its observations given to other landmarks."""
    rng = np.random.default_rng(seed)
    landmark = given.log.landmark.copy()
    wrong = rng.random(len(landmark)) < share
    landmark[wrong] = rng.integers(0, len(given.landmarks_xy), wrong.sum())
    return replace(given, log=replace(given.log, landmark=landmark))


def as_observed(
    given: Drive, classes: tuple[str, ...], fingerprint: str = "made up", radius_m: float = 0.2
) -> LogObservations:
    """The drive as its log tells of it: objects of classes, without the numbers of their landmarks."""
    log, count = given.log, len(given.log)
    points, covariances = points_from_polar(log.range_m, log.bearing_rad, log.covariance)
    return LogObservations(
        1_000 * np.arange(count),
        1_000 * np.arange(count) + 1,
        dead_reckoning(log.start, log.motions),
        np.concatenate([[0.0], np.cumsum(log.motions.distance_m)]),
        np.concatenate([[0.0], np.cumsum(log.motions.turn_rad)]),
        log.pose,
        tuple(classes[i] for i in log.landmark),
        points,
        covariances,
        np.full(len(points), radius_m),
        count + 5,
        fingerprint,
    )
