"""The default way to localize: associate, solve in SE(2), test, and refuse rather than guess."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from toolkit.estimation.pose import PoseSolutions, solve_poses
from toolkit.estimation.sightings import polar_from_points
from toolkit.geometry.se2 import Array, transform_points
from toolkit.landmarks.model import LandmarkMap
from toolkit.landmarks.sightings import known_covariances
from toolkit.landmarks.unique import pairs_by_class, unique_classes
from toolkit.messages.match import LandmarkMatch, Status
from toolkit.messages.scene import SceneObjects


class Settings(Protocol):
    """What of the stage's configuration is used here."""

    @property
    def max_sigma_m(self) -> float: ...
    @property
    def range_sigma_m(self) -> float: ...
    @property
    def bearing_sigma_rad(self) -> float: ...
    @property
    def robust_dof(self) -> float: ...
    @property
    def consistency(self) -> float: ...


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """One bundle's match, and where it was localized its pose (3,) with covariance (3, 3), None if that is unknown."""

    match: LandmarkMatch
    pose: Array | None = None
    covariance: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Objects (K,) of one scene and the landmarks (K,) they are taken for."""

    scene: SceneObjects
    objects: NDArray[np.int64]
    landmarks: NDArray[np.int64]


def locate(scenes: Sequence[SceneObjects], landmark_map: LandmarkMap, settings: Settings) -> list[Located]:
    """Pose of each scene's base in the map, from the landmarks whose class is unique."""
    landmark_of = unique_classes(landmark_map)
    problems = [_Problem(scene, *pairs_by_class(scene.classes, landmark_of)) for scene in scenes]
    located = [_too_few(problem) for problem in problems]
    rows = [i for i, result in enumerate(located) if result is None]
    if rows:
        for i, result in zip(rows, _solve([problems[i] for i in rows], landmark_map, settings), strict=True):
            located[i] = result
    return [result for result in located if result is not None]


def _too_few(problem: _Problem) -> Located | None:
    scene = problem.scene
    if len(set(scene.classes)) < 2:
        return Located(LandmarkMatch(scene.stamp_ns, scene.frame_id, Status.TOO_FEW_OBJECTS))
    if len(problem.objects) < 2:
        return Located(LandmarkMatch(scene.stamp_ns, scene.frame_id, Status.NO_MATCH))
    return None


def _solve(problems: Sequence[_Problem], landmark_map: LandmarkMap, settings: Settings) -> list[Located]:
    """Solve all; drop the worst observation of those that do not fit while three or more are left."""
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
    range_m, bearing_rad, polar = polar_from_points(points, covariances)
    robust = settings.robust_dof or None
    while True:
        solutions = solve_poses(
            landmarks, range_m, bearing_rad, polar, landmark_covariance=spread, mask=mask, robust_dof=robust
        )
        fits = solutions.chi2 <= chi2.ppf(1 - settings.consistency, np.maximum(solutions.dof, 1))
        worse = np.flatnonzero(~fits & (mask.sum(axis=1) > 2))
        if not len(worse):
            break
        mask[worse, np.argmax(np.where(mask, solutions.observation_chi2, -1.0)[worse], axis=1)] = False
    return [_judge(problems[i], i, solutions, mask[i], bool(fits[i]), landmark_map, settings) for i in range(count)]


def _judge(
    problem: _Problem,
    i: int,
    solutions: PoseSolutions,
    used: NDArray[np.bool_],
    fits: bool,
    landmark_map: LandmarkMap,
    settings: Settings,
) -> Located:
    scene, kept = problem.scene, np.flatnonzero(used)
    objects, landmarks = problem.objects[kept], problem.landmarks[kept]
    pose, covariance = solutions.map_from_base[i], solutions.covariance[i]
    finite = np.isfinite(covariance).all()
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])) if finite else np.inf
    status = Status.LOCALIZED
    if not fits:
        status = Status.INCONSISTENT
    elif not solutions.converged[i] or sigma_m > settings.max_sigma_m:
        status = Status.WEAK_GEOMETRY
    miss = transform_points(pose, scene.positions_xy[objects]) - landmark_map.positions_xy[landmarks]
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
    return Located(match, pose, covariance) if status == Status.LOCALIZED else Located(match)
