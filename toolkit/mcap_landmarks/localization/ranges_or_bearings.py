"""Localize by ranges alone, which leave the heading open and often a mirror image, or by bearings alone."""

from collections.abc import Sequence

import numpy as np

from mcap_landmarks.estimation.bearings import solve_bearings
from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.estimation.pose_batch import PoseSolutions
from mcap_landmarks.estimation.ranges import PositionSolutions, solve_ranges
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.correspondences import Bools, Correspondences, Problem
from mcap_landmarks.localization.decision import chi2_limits, of_position
from mcap_landmarks.localization.match import Match
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.match import LandmarkMatch, Status

# Mirror images within so many standard deviations are one position.
_SAME_SIGMAS = 3.0


def by_bearings(pairs: Correspondences, mask: Bools) -> PoseSolutions:
    """Poses from the bearings that `mask` (B, K) leaves."""
    variance = pairs.covariance[..., 1, 1]
    first = solve_bearings(pairs.landmarks_xy, pairs.bearing_rad, variance, mask=mask)
    distance_m = distances(first.map_from_base, pairs)
    # Seen from where the robot is, the landmark's own error is an angle.
    variance = variance + _landmark_variance(pairs) / np.maximum(distance_m, 1e-9) ** 2
    return solve_bearings(pairs.landmarks_xy, pairs.bearing_rad, variance, mask=mask)


def locate_by_ranges(
    problems: Sequence[Problem], pairs: Correspondences, landmark_map: LandmarkMap, config: LocalizeConfig
) -> list[Match]:
    """Positions without heading of bundles of ranges; where the mirror image fits as well, both are candidates."""
    variance = pairs.covariance[..., 0, 0] + _landmark_variance(pairs)
    solved = solve_ranges(pairs.landmarks_xy, pairs.range_m, variance, mask=pairs.mask)
    return [_match(problem, i, solved, pairs, landmark_map, config) for i, problem in enumerate(problems)]


def _match(
    problem: Problem,
    i: int,
    solved: PositionSolutions,
    pairs: Correspondences,
    landmark_map: LandmarkMap,
    config: LocalizeConfig,
) -> Match:
    both, chi2_of = solved.position_xy[i], solved.chi2[i]
    position, covariance, dof = both[0], solved.covariance[i, 0], int(solved.dof[i])
    sigma_m = position_sigma(covariance)
    odds = np.exp(-(chi2_of - chi2_of[0]) / 2)
    apart = np.linalg.norm(both[1] - position) > _SAME_SIGMAS * sigma_m
    mirror_odds = float(odds[1]) if apart else 0.0
    limit = float(chi2_limits(dof, config))
    made = of_position(problem.decision, float(chi2_of[0]), limit, float(sigma_m), mirror_odds, config)
    k = len(problem.objects)
    off_m = np.abs(distances(position[None], pairs.pick(np.array([i])))[0, :k] - pairs.range_m[i, :k])
    shown = both if made.status == Status.AMBIGUOUS else both[:0]
    match = LandmarkMatch(
        problem.scene.stamp_ns,
        problem.scene.frame_id,
        made.status,
        tuple(problem.scene.ids[row] for row in problem.objects),
        tuple(landmark_map.ids[row] for row in problem.landmarks),
        off_m,
        tuple(f"x {x:.3f} m, y {y:.3f} m" for x, y in shown.tolist()),
        (odds / odds.sum())[: len(shown)],
        mirror_odds,
        float(chi2_of[0]),
        dof,
        conditions=made.conditions,
    )
    return Match.of(match, np.array([*position, 0.0]))


def distances(poses: Array, pairs: Correspondences) -> Array:
    """Distances (B, K) to the landmarks from poses (B, 3) or positions (B, 2)."""
    distance_m: Array = np.linalg.norm(pairs.landmarks_xy - poses[:, None, :2], axis=-1)
    return distance_m


def _landmark_variance(pairs: Correspondences) -> Array:
    """Variance (B, K) of each landmark in any one direction."""
    variance: Array = np.trace(pairs.landmark_covariance, axis1=2, axis2=3) / 2
    return variance
