"""Localize where every landmark has a class of its own: associate by class, solve in SE(2), test, refuse."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.calibration import SensorModel, calibrate
from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.pose_batch import PoseSolutions
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.localization.class_association import unique_classes
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.correspondences import Bools, Correspondences, Problem, Rows
from mcap_landmarks.localization.decision import BEARINGS, LEAST_OF_ONE_KIND, RANGES, chi2_limits, of_pose
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.ranges_or_bearings import by_bearings, distances, locate_by_ranges
from mcap_landmarks.localization.validation import check_scale
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.scene import SceneObjects


class UniqueClassLocalizer:
    """Localizes the scenes of one log, batch by batch; what its sensor's ranges mean is found from the first batch."""

    def __init__(self, landmark_map: LandmarkMap, config: LocalizeConfig) -> None:
        self._map = landmark_map
        self._config = config
        self._landmark_of = unique_classes(landmark_map)
        self._sensor: SensorModel | None = None if config.calibrate else SensorModel()

    def locate(self, scenes: Sequence[SceneObjects]) -> list[Match]:
        """Pose of each scene's base in the map, from the landmarks whose class is unique."""
        problems = [Problem.of(scene, self._landmark_of) for scene in scenes]
        ready = [problem for problem in problems if problem.decision.holds]
        located = iter(self._located(ready) if ready else [])
        return [next(located) if problem.decision.holds else _refused(problem) for problem in problems]

    def _located(self, problems: Sequence[Problem]) -> list[Match]:
        """Locate all, those of ranges or bearings alone as such."""
        pairs = Correspondences.of(problems, self._map, self._config)
        ranges, bearings = pairs.ranges_alone(), pairs.bearings_alone()
        asked = list(problems)
        for i in np.flatnonzero(ranges | bearings).tolist():
            asked[i] = problems[i].of_one_kind(RANGES if ranges[i] else BEARINGS)
        many = np.array([problem.decision.holds for problem in asked])
        found = {i: _refused(asked[i]) for i in np.flatnonzero(~many).tolist()}

        def put(chosen: Bools, solve: Callable[[Sequence[Problem], Correspondences], list[Match]]) -> None:
            rows = np.flatnonzero(chosen)
            if len(rows):
                which = rows.tolist()
                found.update(zip(which, solve([asked[i] for i in which], pairs.pick(rows)), strict=True))

        put(many & ~ranges & ~bearings, self._solve)
        put(bearings & many, self._by_bearings)
        put(ranges & many, lambda chosen, part: locate_by_ranges(chosen, part, self._map, self._config))
        return [found[i] for i in range(len(problems))]

    def _by_bearings(self, problems: Sequence[Problem], pairs: Correspondences) -> list[Match]:
        solved, mask = _fitting(lambda mask: by_bearings(pairs, mask), pairs.mask, LEAST_OF_ONE_KIND, self._config)
        distance_m = distances(solved.map_from_base, pairs)
        return [
            _match(problem, i, solved, mask[i], distance_m[i], self._map, self._config)
            for i, problem in enumerate(problems)
        ]

    def _solve(self, problems: Sequence[Problem], pairs: Correspondences) -> list[Match]:
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
                pairs.landmarks_xy,
                pairs.range_m,
                pairs.bearing_rad,
                pairs.covariance,
                landmark_covariance=pairs.landmark_covariance,
                mask=pairs.mask,
            ).model
        distance_m = self._sensor.distance_m(pairs.range_m, pairs.bearing_rad)
        # The log tells how range and bearing compare; in all, sigmas stay as large as they are given.
        shape = self._sensor.scale / self._sensor.scale.max()
        noise = pairs.covariance * np.outer(shape, shape)

        def solve(mask: Bools) -> PoseSolutions:
            return solve_poses(
                pairs.landmarks_xy,
                distance_m,
                pairs.bearing_rad,
                noise,
                landmark_covariance=pairs.landmark_covariance,
                mask=mask,
                robust_dof=config.robust_dof or None,
            )

        solutions, mask = _fitting(solve, pairs.mask, 2, config)
        return [
            _match(problem, i, solutions, mask[i], distance_m[i], self._map, config)
            for i, problem in enumerate(problems)
        ]


def _fitting(
    solve: Callable[[Bools], PoseSolutions], mask: Bools, least: int, config: LocalizeConfig
) -> tuple[PoseSolutions, Bools]:
    """Solutions without the worst of what does not fit, of which `least` stay; and what (B, K) stays.

    One outlier at a time, by its normalised residual: data snooping (Baarda 1968) until the whole fits.
    """
    mask = mask.copy()
    while True:
        solutions = solve(mask)
        fits = solutions.chi2 <= chi2_limits(solutions.dof, config)
        worse: Rows = np.flatnonzero(~fits & (mask.sum(axis=1) > least))
        if not len(worse):
            return solutions, mask
        mask[worse, np.argmax(np.where(mask, solutions.observation_chi2, -1.0)[worse], axis=1)] = False


def _refused(problem: Problem) -> Match:
    """The match of a bundle for which no pose was looked for."""
    scene, made = problem.scene, problem.decision
    return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, made.status, conditions=made.conditions))


def _match(
    problem: Problem,
    i: int,
    solutions: PoseSolutions,
    used: NDArray[np.bool_],
    distance_m: Array,
    landmark_map: LandmarkMap,
    config: LocalizeConfig,
) -> Match:
    scene, kept = problem.scene, np.flatnonzero(used)
    objects, landmarks = problem.objects[kept], problem.landmarks[kept]
    pose, covariance = solutions.map_from_base[i], solutions.covariance[i]
    chi2, dof = float(solutions.chi2[i]), int(solutions.dof[i])
    limit, converged = float(chi2_limits(dof, config)), bool(solutions.converged[i])
    made = of_pose(problem.decision, chi2, limit, covariance, config, converged=converged)
    points = scene.positions_xy[objects]
    points = points * (distance_m[kept] / np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9))[:, None]
    miss = transform_points(pose, points) - landmark_map.positions_xy[landmarks]
    message = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        made.status,
        tuple(scene.ids[row] for row in objects),
        tuple(landmark_map.ids[row] for row in landmarks),
        np.linalg.norm(miss, axis=1),
        chi2=chi2,
        dof=dof,
        conditions=made.conditions,
    )
    return Match.of(message, pose, covariance)
