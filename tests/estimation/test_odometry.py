"""Odometry as a random walk: how far a motion can be trusted."""

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, dead_reckoning, motion_covariance, random_walk
from mcap_landmarks.geometry import se2

from tests.estimation.worlds import Array, nees

NOISE = OdometryNoise(0.1, 0.2, 0.3)
FLOOR = 1e-10


def one(relative: Array, way_m: float, turned_rad: float, noise: OdometryNoise = NOISE) -> Array:
    """Covariance (3, 3) of one motion."""
    motions = Motions(np.array([relative]), np.array([way_m]), np.array([turned_rad]))
    return np.asarray(motion_covariance(motions, noise)[0])


def test_straight_ahead_the_position_errs_along_and_a_quarter_of_that_across() -> None:
    expected = np.diag([0.01 * 2, 0.01 * 2 / 4, 0.0]) + FLOOR * np.diag([1, 0.25 + 4 / 3, 1])
    expected[1, 2] = expected[2, 1] = FLOOR
    straight = one(np.array([2.0, 0.0, 0.0]), 2.0, 0.0, OdometryNoise(0.1, 0.0, 0.0))
    np.testing.assert_allclose(straight, expected, rtol=1e-9, atol=1e-18)


def test_a_heading_that_errs_on_the_way_errs_across_the_chord() -> None:
    """A third of the heading's variance, times the chord squared; half of it, times the chord, in common."""
    heading = 0.2**2 * 2 + FLOOR
    expected = np.array([[0, 0, 0], [0, heading * 4 / 3, heading], [0, heading, heading]])
    ahead = one(np.array([2.0, 0.0, 0.0]), 2.0, 0.0, OdometryNoise(0.0, 0.2, 0.0))
    np.testing.assert_allclose(ahead, expected, atol=2 * FLOOR)
    sideways = one(np.array([0.0, 2.0, 0.0]), 2.0, 0.0, OdometryNoise(0.0, 0.2, 0.0))
    turned = np.array([[heading * 4 / 3, 0, -heading], [0, 0, 0], [-heading, 0, heading]])
    np.testing.assert_allclose(sideways, turned, atol=2 * FLOOR)


def test_the_longer_way_round_errs_more_than_the_chord() -> None:
    short, long = one(np.array([1.0, 0.0, 0.0]), 1.0, 0.0), one(np.array([1.0, 0.0, 0.0]), 4.0, 0.0)
    np.testing.assert_allclose(long, 4 * short, rtol=1e-6)


def test_turning_in_place_errs_in_heading_alone() -> None:
    spun = one(np.array([0.0, 0.0, 0.1]), 0.0, 2.0)
    np.testing.assert_allclose(spun, np.diag([FLOOR, FLOOR, 0.09 * 2 + FLOOR]), rtol=1e-9, atol=1e-15)


def test_a_robot_that_stands_for_long_stays_where_it_is() -> None:
    still = Motions(np.zeros((5000, 3)), np.zeros(5000), np.zeros(5000))
    covariances = motion_covariance(still, OdometryNoise())
    np.testing.assert_allclose(covariances, np.tile(FLOOR * np.eye(3), (5000, 1, 1)))
    assert np.sqrt(covariances.sum(axis=0).diagonal()).max() < 1e-3


def test_the_covariance_of_a_motion_is_honest() -> None:
    """Hundreds of arcs of one metre, a centimetre after the other, each with an error of its own."""
    rng, steps, count = np.random.default_rng(0), 100, 1000
    noise, turn = OdometryNoise(0.02, 0.05, 0.1), 0.6
    way = 1 / steps
    heading = np.sqrt(noise.heading_per_metre_rad**2 * way + noise.heading_per_radian_rad**2 * turn * way)
    ahead = way + rng.normal(0, noise.position_per_metre_m * way**0.5, (count, steps))
    aside = rng.normal(0, noise.position_per_metre_m * way**0.5 / 2, (count, steps))
    turns = turn * way + rng.normal(0, heading, (count, steps))
    ends = np.array(
        [
            dead_reckoning(
                np.zeros(3), Motions(np.column_stack(errors), np.full(steps, way), np.full(steps, turn * way))
            )[-1]
            for errors in zip(ahead, aside, turns, strict=True)
        ]
    )
    meant = dead_reckoning(
        np.zeros(3), Motions(np.tile([way, 0, turn * way], (steps, 1)), np.full(steps, way), np.full(steps, turn * way))
    )[-1]
    whole = Motions(meant[None], np.ones(1), np.full(1, turn))
    assert 0.9 <= nees(ends - meant, np.tile(motion_covariance(whole, noise), (count, 1, 1))) <= 1.1


def test_dead_reckoning_composes_the_motions() -> None:
    relative = np.array([[1.0, 0.5, 0.4], [2.0, -0.3, 3.0], [0.1, 0.0, -0.2]])
    start = np.array([3.0, 1.0, 2.0])
    poses = dead_reckoning(start, Motions(relative, np.ones(3), np.ones(3)))
    expected = [start]
    for step in relative:
        expected.append(se2.compose(expected[-1], step))
    np.testing.assert_allclose(se2.between(np.array(expected), poses), 0, atol=1e-12)
    assert poses[2, 2] == pytest.approx(5.4 - 2 * np.pi)


def test_a_walk_is_told_from_driving_however_odometry_is_timed() -> None:
    """The steps' own variance, of a robot that speeds up and turns meanwhile; 3000 steps tell it to 5 %."""
    rng = np.random.default_rng(0)
    stamps_ns = np.cumsum(rng.integers(20, 40, 3001)) * 10**6
    steps_s, times_s = np.diff(stamps_ns) / 1e9, stamps_ns[1:] / 1e9
    driven = np.column_stack([1 + np.sin(times_s), np.zeros(3000), np.cos(times_s)]) * steps_s[:, None]
    root = np.array([[0.04, 0.0, 0.0], [0.0, 0.0, 0.0], [0.01, 0.0, 0.02]])
    slipped = driven + np.sqrt(steps_s)[:, None] * (rng.normal(size=(3000, 3)) @ root.T)
    smooth, jagged = (dead_reckoned(steps) for steps in (driven, slipped))
    np.testing.assert_allclose(random_walk(stamps_ns, jagged), root @ root.T, atol=0.05 * 0.04**2)
    assert np.trace(random_walk(stamps_ns, smooth)) < 1e-3 * np.trace(root @ root.T)
    assert not random_walk(stamps_ns[:3], jagged[:3]).any()


def dead_reckoned(steps: Array) -> Array:
    """The poses (N + 1, 3) that N twists (N, 3) lead to."""
    poses = [np.zeros(3)]
    for step in steps:
        poses.append(se2.compose(poses[-1], se2.exp(step)))
    return np.array(poses)
