"""A start that needs no truth: landmarks where most observations agree, poses that never drift far."""

from dataclasses import replace

import numpy as np
from mcap_landmarks.estimation.odometry import OdometryNoise, dead_reckoning
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.common_frame import align
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.initialisation import robust_medoids, solve_alone
from mcap_landmarks.mapping.log_graph import LogNoise

from tests.mapping.drives import Array, drive, landmarks_beside

UNKNOWN = np.full((1, 2), np.nan)


def medoid(points: list[list[float]], variance: list[float], known: Array = UNKNOWN) -> list[float]:
    rows = np.zeros(len(points), dtype=np.int64)
    moved = robust_medoids(np.array(points), np.array(variance), rows, known, 1.0)
    return [round(value, 9) for value in moved[0].tolist()]


def test_a_landmark_is_where_most_observations_agree() -> None:
    """Not at their mean, which the last one draws away, nor at the first one, which is a misreading."""
    points = [[8.0, 8.0], [1.0, 1.0], [1.1, 1.0], [1.0, 1.1], [50.0, 0.0]]
    assert medoid(points, [0.01] * 5) == [1.0, 1.0]


def test_sharper_observations_count_more() -> None:
    assert medoid([[0.0, 0.0], [0.2, 0.0], [1.0, 0.0]], [1.0, 1.0, 1e-4]) == [1.0, 0.0]
    assert medoid([[0.0, 0.0], [0.2, 0.0], [1.0, 0.0]], [1.0, 1.0, 1.0]) == [0.2, 0.0]


def test_a_landmark_stays_where_it_is_unless_observations_agree_better_elsewhere() -> None:
    points = [[1.2, 1.0], [1.0, 1.0], [1.0, 1.2]]
    assert medoid(points, [0.1] * 3, np.array([[1.07, 1.07]])) == [1.07, 1.07]
    assert medoid(points, [0.1] * 3, np.array([[3.0, 1.1]])) == [1.0, 1.0]


def test_each_landmark_has_its_own_observations_and_one_without_any_stays() -> None:
    points = np.array([[1.0, 0.0], [5.0, 5.0], [1.0, 0.1], [5.0, 5.2], [1.0, 0.1]])
    known = np.array([[np.nan, np.nan], [7.0, 7.0], [np.nan, np.nan], [np.nan, np.nan]])
    moved = robust_medoids(points, np.full(5, 0.01), np.array([0, 2, 0, 2, 0]), known, 1.0)
    np.testing.assert_array_equal(moved, [[1.0, 0.1], [7.0, 7.0], [5.0, 5.0], [np.nan, np.nan]])


def test_candidates_are_spread_over_all_observations() -> None:
    """A long row of misreadings first, then what is right."""
    points = np.concatenate([np.random.default_rng(0).uniform(-50, 50, (60, 2)), np.full((90, 2), 3.0)])
    moved = robust_medoids(points, np.full(150, 0.01), np.zeros(150, dtype=np.int64), UNKNOWN, 1.0)
    np.testing.assert_array_equal(moved, [[3.0, 3.0]])


def test_a_drive_whose_odometry_turns_about_is_solved_all_the_same() -> None:
    """Three laps with a heading that errs by more than a radian: dead reckoning leads far from the minimum."""
    noise = OdometryNoise(0.02, 0.15, 0.1)
    given = drive(landmarks_beside(6.0, 12, 1), 6.0, 1, laps=3, step_m=0.5, odometry=noise)
    reckoned = dead_reckoning(given.log.start, given.log.motions)
    off = se2.between(se2.compose(se2.inverse(given.poses[0]), given.poses), reckoned)
    assert np.abs(off[:, 2]).max() > 1.0
    assumed = LogNoise(noise, np.ones(2), np.zeros(2), np.ones(len(given.log.pose), dtype=np.int64))
    numbers, solved = solve_alone(given.log, assumed, BuildMapConfig())
    assert solved.termination.converged
    assert numbers.tolist() == list(range(12))
    np.testing.assert_array_equal(solved.state.poses[0], given.log.start)
    onto = align(solved.state.landmarks_xy, given.landmarks_xy)
    miss = se2.transform_points(onto, solved.state.landmarks_xy) - given.landmarks_xy
    assert np.abs(miss).max() < 0.2


def test_landmark_numbers_may_have_gaps_and_a_log_may_be_short() -> None:
    given = drive(landmarks_beside(6.0, 12, 1), 6.0, 1, laps=0.2, step_m=0.5)
    log = replace(given.log, landmark=10 * given.log.landmark + 3)
    assumed = LogNoise(OdometryNoise(), np.ones(2), np.ones(2), np.ones(len(log.pose), dtype=np.int64))
    numbers, solved = solve_alone(log, assumed, BuildMapConfig())
    assert numbers.tolist() == sorted({10 * number + 3 for number in given.log.landmark.tolist()})
    assert solved.state.landmarks_xy.shape == (len(numbers), 2)
    assert len(solved.state.poses) == len(log) < 30
