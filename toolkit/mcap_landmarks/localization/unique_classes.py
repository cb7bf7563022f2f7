"""Localize where every landmark has a class of its own: associate by class, solve in SE(2), test, refuse."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mcap_landmarks.estimation.batch import PoseSolutions
from mcap_landmarks.estimation.calibration import SensorModel, calibrate
from mcap_landmarks.estimation.pose import position_sigma, solve_poses
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.localization.class_association import pairs_by_class, unique_classes
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.correspondences import Bools, Given, Problem, Rows
from mcap_landmarks.localization.decision import Match
from mcap_landmarks.localization.ranges_or_bearings import LEAST, by_bearings, distances, locate_by_ranges
from mcap_landmarks.localization.validation import check_scale
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scene import SceneObjects


class UniqueLocator:
    """Localizes the scenes of one log, batch by batch; what its sensor's ranges mean is found from the first batch."""

    def __init__(self, landmark_map: LandmarkMap, config: LocalizeConfig) -> None:
        self._map = landmark_map
        self._config = config
        self._landmark_of = unique_classes(landmark_map)
        self._sensor: SensorModel | None = None if config.calibrate else SensorModel()

    def locate(self, scenes: Sequence[SceneObjects]) -> list[Match]:
        """Pose of each scene's base in the map, from the landmarks whose class is unique."""
        problems = [Problem(scene, *pairs_by_class(scene.classes, self._landmark_of)) for scene in scenes]
        located = [_too_few(problem) for problem in problems]
        rows = [i for i, result in enumerate(located) if result is None]
        if rows:
            for i, result in zip(rows, self._located([problems[i] for i in rows]), strict=True):
                located[i] = result
        return [result for result in located if result is not None]

    def _located(self, problems: Sequence[Problem]) -> list[Match]:
        """Locate all, those of ranges or bearings alone as such."""
        given = Given.of(problems, self._map, self._config)
        ranges, bearings = given.ranges_alone(), given.bearings_alone()
        many = given.mask.sum(axis=1) >= LEAST
        few = np.flatnonzero((ranges | bearings) & ~many).tolist()
        found = {i: _none(problems[i]) for i in few}

        def put(chosen: Bools, solve: Callable[[Sequence[Problem], Given], list[Match]]) -> None:
            rows = np.flatnonzero(chosen)
            if len(rows):
                which = rows.tolist()
                found.update(zip(which, solve([problems[i] for i in which], given.pick(rows)), strict=True))

        put(~ranges & ~bearings, self._solve)
        put(bearings & many, self._by_bearings)
        put(ranges & many, lambda chosen, part: locate_by_ranges(chosen, part, self._map, self._config))
        return [found[i] for i in range(len(problems))]

    def _by_bearings(self, problems: Sequence[Problem], given: Given) -> list[Match]:
        solved, mask, fits = _fitting(lambda mask: by_bearings(given, mask), given.mask, LEAST, self._config)
        distance_m = distances(solved.map_from_base, given)
        return [
            _judge(problem, i, solved, mask[i], distance_m[i], bool(fits[i]), self._map, self._config)
            for i, problem in enumerate(problems)
        ]

    def _solve(self, problems: Sequence[Problem], given: Given) -> list[Match]:
        """Solve all; drop the worst observation of those that do not fit while three or more are left.

        Raises:
            MapError: map and log are in different units.
        """
        config = self._config
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

        def solve(mask: Bools) -> PoseSolutions:
            return solve_poses(
                given.landmarks_xy,
                distance_m,
                given.bearing_rad,
                noise,
                landmark_covariance=given.landmark_covariance,
                mask=mask,
                robust_dof=config.robust_dof or None,
            )

        solutions, mask, fits = _fitting(solve, given.mask, 2, config)
        return [
            _judge(problem, i, solutions, mask[i], distance_m[i], bool(fits[i]), self._map, config)
            for i, problem in enumerate(problems)
        ]


def _fitting(
    solve: Callable[[Bools], PoseSolutions], mask: Bools, least: int, config: LocalizeConfig
) -> tuple[PoseSolutions, Bools, Bools]:
    """Solutions without the worst of what does not fit, of which `least` stay; what (B, K) stays; who (B,) fits."""
    mask = mask.copy()
    while True:
        solutions = solve(mask)
        fits = solutions.chi2 <= chdtri(np.maximum(solutions.dof, 1), config.consistency)
        worse: Rows = np.flatnonzero(~fits & (mask.sum(axis=1) > least))
        if not len(worse):
            return solutions, mask, fits
        mask[worse, np.argmax(np.where(mask, solutions.observation_chi2, -1.0)[worse], axis=1)] = False


def _none(problem: Problem) -> Match:
    return Match(LandmarkMatch(problem.scene.stamp_ns, problem.scene.frame_id, Status.TOO_FEW_OBJECTS))


def _too_few(problem: Problem) -> Match | None:
    scene = problem.scene
    if len(set(scene.classes)) < 2:
        return _none(problem)
    if len(problem.objects) < 2:
        return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, Status.NO_MATCH))
    return None


def _judge(
    problem: Problem,
    i: int,
    solutions: PoseSolutions,
    used: NDArray[np.bool_],
    distance_m: Array,
    fits: bool,
    landmark_map: LandmarkMap,
    config: LocalizeConfig,
) -> Match:
    scene, kept = problem.scene, np.flatnonzero(used)
    objects, landmarks = problem.objects[kept], problem.landmarks[kept]
    pose, covariance = solutions.map_from_base[i], solutions.covariance[i]
    finite = np.isfinite(covariance).all()
    sigma_m = float(position_sigma(covariance)) if finite else np.inf
    sigma_deg = float(np.degrees(np.sqrt(covariance[2, 2]))) if finite else np.inf
    status = Status.LOCALIZED
    if not fits:
        status = Status.INCONSISTENT
    elif not solutions.converged[i] or sigma_m > config.max_sigma_m or sigma_deg > config.max_sigma_deg:
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
