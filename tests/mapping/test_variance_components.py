"""Variance component estimation: the sigmas that were simulated are found in the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.factor_graph import GraphSolution, State, minimise
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.mapping import variance_components
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.log_graph import LandmarkObservations, LogNoise, graph_of
from mcap_landmarks.mapping.variance_components import assumed_noise, estimate_noise, places, solve_with_its_noise
from numpy.typing import NDArray

from tests.mapping.drives import Drive, drive, landmarks_beside

Ints = NDArray[np.int64]

CONFIG = BuildMapConfig()


def loop(laps: float = 1.2, seed: int = 0, **given: float) -> Drive:
    return drive(landmarks_beside(6.0, 12, seed), 6.0, seed, laps=laps, step_m=0.5, **given)


def log_of(way_m: list[float], turn_rad: list[float], pose: list[int], landmark: list[int]) -> LandmarkObservations:
    count = len(pose)
    motions = Motions(np.zeros((len(way_m), 3)), np.array(way_m), np.array(turn_rad))
    none = np.ones(count), np.zeros(count), np.tile(np.eye(2), (count, 1, 1))
    return LandmarkObservations(np.zeros(3), motions, np.array(pose), np.array(landmark), *none)


def test_observations_of_a_landmark_are_from_one_place_until_the_robot_has_moved() -> None:
    """By more than a quarter of a metre since the place's first one."""
    log = log_of([0.1] * 6, [0.0] * 6, [0, 1, 2, 3, 5, 6], [4] * 6)
    assert places(log).tolist() == [0, 0, 0, 1, 1, 2]


def test_or_until_it_has_turned() -> None:
    log = log_of([0.0] * 4, [0.2, 0.2, 0.2, 0.05], [0, 1, 2, 3, 4], [4] * 5)
    assert places(log).tolist() == [0, 0, 1, 1, 1]


def test_no_two_landmarks_share_a_place() -> None:
    log = log_of([0.1, 0.1], [0.0, 0.0], [0, 0, 1, 1, 2], [9, 2, 9, 2, 9])
    assert places(log).tolist() == [1, 0, 1, 0, 1]


def test_the_noise_to_start_with_takes_a_place_for_one_observation() -> None:
    noise = assumed_noise(np.array([1, 0, 1, 1]), OdometryNoise(0.1, 0.2, 0.3))
    assert noise.odometry == OdometryNoise(0.1, 0.2, 0.3)
    assert noise.scale.tolist() == noise.alike.tolist() == [1, 1]
    assert noise.repeats.tolist() == [3, 1, 3, 3]


def solved_right(given: Drive, odometry: OdometryNoise, place: Ints, robust_dof: float) -> GraphSolution:
    """The minimum near the truth, where no error is like another."""
    noise = replace(assumed_noise(place, odometry), alike=np.zeros(2))
    numbers, rows = np.unique(given.log.landmark, return_inverse=True)
    return minimise(graph_of(given.log, rows, noise), State(given.poses, given.landmarks_xy[numbers]), robust_dof)


def once(given: Drive, odometry: OdometryNoise, repeats: int = 1) -> LogNoise:
    """One round of estimation; so many observations in a row are from one place."""
    place = np.arange(len(given.log.pose)) // repeats
    return estimate_noise(given.log, place, odometry, solved_right(given, odometry, place, 1e9))


TRUE = OdometryNoise(0.05, 0.02, 0.04)


def test_right_noise_is_left_as_it_is() -> None:
    found = once(loop(4, odometry=TRUE, sigma_range_m=0.03), TRUE)
    np.testing.assert_allclose(found.scale, 1, atol=0.05)
    assert found.odometry.position_per_metre_m == pytest.approx(0.05, rel=0.1)
    assert found.odometry.heading_per_metre_rad == pytest.approx(0.02, rel=0.1)
    assert found.odometry.heading_per_radian_rad == pytest.approx(0.04, rel=0.1)


def test_sensor_sigmas_are_recovered() -> None:
    """Most of the way from one to what was simulated: what was given counts as 200 residuals."""
    given = loop(8, odometry=TRUE)
    off = np.array([0.8, 1.25])
    wrong = replace(given, log=replace(given.log, covariance=given.log.covariance * np.outer(off, off)))
    np.testing.assert_allclose(once(wrong, TRUE).scale, [1.16, 0.90], atol=0.02)


def test_variances_are_squared_residuals_over_their_redundancy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Winsorised at three of the given sigmas, and beside 200 residuals that agree with them."""
    monkeypatch.setattr(variance_components, "_PROBES", 4000)
    given = loop(0.6, odometry=TRUE, sigma_range_m=0.06)
    log = replace(given.log, covariance=given.log.covariance * np.outer([0.4, 1.5], [0.4, 1.5]))
    place = np.arange(len(log.pose))
    solved = solved_right(replace(given, log=log), TRUE, place, 3.0)
    found = estimate_noise(log, place, TRUE, solved)
    dense = solved.jacobian.toarray()
    left = 1 - np.einsum("ij,ji->i", dense, np.linalg.pinv(dense))
    numbers = 2 * len(log.pose)
    state = solved.state
    d = state.landmarks_xy[solved.graph.observation_landmark] - state.poses[log.pose, :2]
    miss = (
        log.range_m - np.hypot(d[:, 0], d[:, 1]),
        wrap(log.bearing_rad - np.arctan2(d[:, 1], d[:, 0]) + state.poses[log.pose, 2]),
    )
    for axis in (0, 1):
        sigma = np.sqrt(log.covariance[0, axis, axis])
        squares = (np.clip(miss[axis] / sigma, -3, 3) ** 2).sum()
        expected = np.sqrt((squares + 200) / (left[axis:numbers:2].sum() + 200))
        assert found.scale[axis] == pytest.approx(expected, rel=0.005)
    moves, of_moves = solved.residuals[1], left[numbers:].reshape(-1, 3)
    heading = np.sqrt(((moves[:, 0] ** 2).sum() + 200) / (of_moves[:, 0].sum() + 200))
    position = np.sqrt(((moves[:, 1:] ** 2).sum() + 200) / (of_moves[:, 1:].sum() + 200))
    assert found.odometry.heading_per_metre_rad == pytest.approx(0.02 * heading, rel=0.005)
    assert found.odometry.heading_per_radian_rad == pytest.approx(0.04 * heading, rel=0.005)
    assert found.odometry.position_per_metre_m == pytest.approx(0.05 * position, rel=0.005)


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_odometry_sigmas_move_towards_the_simulated_ones(times: float) -> None:
    """As far as the redundancy that observations leave to motions allows, beside the 200 residuals assumed."""
    given = loop(8, odometry=TRUE)
    assumed = OdometryNoise(0.05 * times, 0.02 * times, 0.04 * times)
    found = once(given, assumed).odometry
    heading = found.heading_per_metre_rad / assumed.heading_per_metre_rad
    assert heading == pytest.approx(found.heading_per_radian_rad / assumed.heading_per_radian_rad)
    position = found.position_per_metre_m / assumed.position_per_metre_m
    for share in (heading, position):
        assert 1 < 1 / share < 2 if times > 1 else 1 < share < 2


def test_the_redundancy_is_what_unknowns_leave_of_residuals(monkeypatch: pytest.MonkeyPatch) -> None:
    given = loop(0.5)
    solved = solved_right(given, TRUE, np.arange(len(given.log.pose)), 1.0)
    dense = solved.jacobian.toarray()
    hat = dense @ np.linalg.inv(dense.T @ dense) @ dense.T
    monkeypatch.setattr(variance_components, "_PROBES", 4000)
    found = variance_components._redundancy(solved, seed=0)
    np.testing.assert_allclose(found, 1 - np.diag(hat), atol=0.1)
    assert found.sum() == pytest.approx(dense.shape[0] - dense.shape[1], rel=0.02)


def test_a_wrong_observation_counts_as_three_sigmas_at_most() -> None:
    given = loop(4, odometry=TRUE)
    log = replace(given.log, range_m=given.log.range_m + 5.0 * (np.arange(len(given.log.pose)) % 40 == 0))
    place = np.arange(len(log.pose))
    found = estimate_noise(log, place, TRUE, solved_right(replace(given, log=log), TRUE, place, 1.0))
    assert 1.0 < found.scale[0] < 1.25


def test_errors_from_one_place_that_are_alike_are_told_from_those_that_are_not() -> None:
    given = loop(6, odometry=TRUE, sigma_range_m=1e-4)
    count, repeats = len(given.log.pose), 3
    shared = np.repeat(np.random.default_rng(0).normal(0, 0.1, count // repeats + 1), repeats)[:count]
    log = replace(
        given.log, range_m=given.log.range_m + shared, covariance=np.tile(np.diag([0.01, 1e-4]), (count, 1, 1))
    )
    found = once(replace(given, log=log), TRUE, repeats)
    assert found.alike[0] > 0.9
    assert found.alike[1] < 0.3
    assert found.repeats.max() == repeats


def test_correlation_is_that_of_an_analysis_of_variance() -> None:
    values, place = np.array([1.0, 3.0, -2.0, -4.0, 9.0]), np.array([0, 0, 1, 1, 2])
    # Within places: 4 squares over 2 degrees; in all: 30 over 4. What was assumed, 1, counts as 200.
    alike = 1 - 2 / 7.5
    found = variance_components._intraclass_correlation(values, place)
    assert found == pytest.approx((alike * 2 + 200) / 202)
    assert variance_components._intraclass_correlation(values, np.arange(5)) == 1.0
    opposed = np.array([1.0, -1.0] * 300)
    assert variance_components._intraclass_correlation(opposed, np.repeat(np.arange(300), 2)) == pytest.approx(0.4)
    assert variance_components._intraclass_correlation(0 * opposed, np.repeat(np.arange(300), 2)) == 1.0


def test_solving_and_estimating_take_turns_and_say_whether_the_noise_has_settled() -> None:
    given = loop(1.2)
    started_right = solve_with_its_noise(
        given.log, replace(CONFIG, odometry_position_m=0.02, odometry_heading_rad=0.009, odometry_turning_rad=0.02)
    )
    assert started_right.termination.converged
    assert started_right.termination.iterations == 2
    assert 1 < started_right.iterations < 50
    started_wrong = solve_with_its_noise(given.log, CONFIG)
    assert not started_wrong.termination.converged
    sigma = started_wrong.noise.odometry.heading_per_metre_rad
    assert 0.009 < sigma < 0.05
