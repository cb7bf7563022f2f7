"""Localize where every landmark has a class of its own: associate by class, solve in SE(2), test, refuse."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from toolkit.estimation.batch import PoseSolutions
from toolkit.estimation.calibration import SensorModel, calibrate
from toolkit.estimation.pose import solve_poses
from toolkit.estimation.sightings import polar_from_points
from toolkit.geometry.se2 import Array, transform_points
from toolkit.landmarks.model import LandmarkMap
from toolkit.landmarks.plausible import check_scale
from toolkit.landmarks.sightings import known_covariances
from toolkit.landmarks.unique import pairs_by_class, unique_classes
from toolkit.landmarks.verdicts import Match
from toolkit.messages.match import LandmarkMatch, Status
from toolkit.messages.scene import SceneObjects


class Settings(Protocol):
    """What of the stage's configuration is used here."""

    @property
    def max_sigma_m(self) -> float: ...
    @property
    def max_sigma_deg(self) -> float: ...
    @property
    def range_sigma_m(self) -> float: ...
    @property
    def bearing_sigma_rad(self) -> float: ...
    @property
    def robust_dof(self) -> float: ...
    @property
    def consistency(self) -> float: ...
    @property
    def calibrate(self) -> bool: ...


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Objects (K,) of one scene and the landmarks (K,) they are taken for."""

    scene: SceneObjects
    objects: NDArray[np.int64]
    landmarks: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class _Given:
    """Problems as arrays (B, K), padded to the largest; `mask` says what is there. See `solve_poses`."""

    landmarks_xy: Array
    landmark_covariance: Array
    range_m: Array
    bearing_rad: Array
    covariance: Array
    mask: NDArray[np.bool_]

    @classmethod
    def of(cls, problems: Sequence[_Problem], landmark_map: LandmarkMap, settings: Settings) -> Self:
        """Arrays of B problems."""
        count, width = len(problems), max(len(problem.objects) for problem in problems)
        points, covariances = np.ones((count, width, 2)), np.tile(np.eye(2), (count, width, 1, 1))
        landmarks, spread = np.zeros((count, width, 2)), np.zeros((count, width, 2, 2))
        mask = np.zeros((count, width), dtype=np.bool_)
        for i, problem in enumerate(problems):
            k = len(problem.objects)
            mask[i, :k] = True
            points[i, :k] = problem.scene.positions_xy[problem.objects]
            known = known_covariances(problem.scene, settings.range_sigma_m, settings.bearing_sigma_rad)
            covariances[i, :k] = known[problem.objects]
            landmarks[i, :k] = landmark_map.positions_xy[problem.landmarks]
            spread[i, :k] = landmark_map.covariances[problem.landmarks]
        return cls(landmarks, spread, *polar_from_points(points, covariances), mask)


class UniqueLocator:
    """Localizes the scenes of one log, batch by batch; what its sensor's ranges mean is found from the first batch."""

    def __init__(self, landmark_map: LandmarkMap, settings: Settings) -> None:
        self._map = landmark_map
        self._settings = settings
        self._landmark_of = unique_classes(landmark_map)
        self._sensor: SensorModel | None = None if settings.calibrate else SensorModel()

    def locate(self, scenes: Sequence[SceneObjects]) -> list[Match]:
        """Pose of each scene's base in the map, from the landmarks whose class is unique."""
        problems = [_Problem(scene, *pairs_by_class(scene.classes, self._landmark_of)) for scene in scenes]
        located = [_too_few(problem) for problem in problems]
        rows = [i for i, result in enumerate(located) if result is None]
        if rows:
            for i, result in zip(rows, self._solve([problems[i] for i in rows]), strict=True):
                located[i] = result
        return [result for result in located if result is not None]

    def _solve(self, problems: Sequence[_Problem]) -> list[Match]:
        """Solve all; drop the worst observation of those that do not fit while three or more are left.

        Raises:
            MapError: map and log are in different units.
        """
        settings = self._settings
        given = _Given.of(problems, self._map, settings)
        check_scale(
            [problem.scene.positions_xy[problem.objects] for problem in problems],
            [self._map.positions_xy[problem.landmarks] for problem in problems],
        )
        if self._sensor is None:
            self._sensor = calibrate(
                given.landmarks_xy,
                given.range_m,
                given.bearing_rad,
                given.covariance,
                landmark_covariance=given.landmark_covariance,
                mask=given.mask,
            )
        distance_m = self._sensor.distance_m(given.range_m, given.bearing_rad)
        # The log tells how range and bearing compare; in all, sigmas stay as large as they are given.
        shape = self._sensor.scale / self._sensor.scale.max()
        noise = given.covariance * np.outer(shape, shape)
        mask = given.mask.copy()
        while True:
            solutions = solve_poses(
                given.landmarks_xy,
                distance_m,
                given.bearing_rad,
                noise,
                landmark_covariance=given.landmark_covariance,
                mask=mask,
                robust_dof=settings.robust_dof or None,
            )
            fits = solutions.chi2 <= chi2.ppf(1 - settings.consistency, np.maximum(solutions.dof, 1))
            worse = np.flatnonzero(~fits & (mask.sum(axis=1) > 2))
            if not len(worse):
                break
            mask[worse, np.argmax(np.where(mask, solutions.observation_chi2, -1.0)[worse], axis=1)] = False
        return [
            _judge(problem, i, solutions, mask[i], distance_m[i], bool(fits[i]), self._map, settings)
            for i, problem in enumerate(problems)
        ]


def _too_few(problem: _Problem) -> Match | None:
    scene = problem.scene
    if len(set(scene.classes)) < 2:
        return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, Status.TOO_FEW_OBJECTS))
    if len(problem.objects) < 2:
        return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, Status.NO_MATCH))
    return None


def _judge(
    problem: _Problem,
    i: int,
    solutions: PoseSolutions,
    used: NDArray[np.bool_],
    distance_m: Array,
    fits: bool,
    landmark_map: LandmarkMap,
    settings: Settings,
) -> Match:
    scene, kept = problem.scene, np.flatnonzero(used)
    objects, landmarks = problem.objects[kept], problem.landmarks[kept]
    pose, covariance = solutions.map_from_base[i], solutions.covariance[i]
    finite = np.isfinite(covariance).all()
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])) if finite else np.inf
    sigma_deg = float(np.degrees(np.sqrt(covariance[2, 2]))) if finite else np.inf
    status = Status.LOCALIZED
    if not fits:
        status = Status.INCONSISTENT
    elif not solutions.converged[i] or sigma_m > settings.max_sigma_m or sigma_deg > settings.max_sigma_deg:
        status = Status.WEAK_GEOMETRY
    points = scene.positions_xy[objects]
    points = points * (distance_m[kept] / np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9))[:, None]
    miss = transform_points(pose, points) - landmark_map.positions_xy[landmarks]
    match = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        status,
        tuple(scene.ids[row] for row in objects),
        tuple(landmark_map.ids[row] for row in landmarks),
        np.linalg.norm(miss, axis=1),
        chi2=float(solutions.chi2[i]),
        dof=int(solutions.dof[i]),
    )
    return Match(match, pose, covariance) if status == Status.LOCALIZED else Match(match)
