"""How unsure objects are where a scan could not be de-skewed."""

import numpy as np
import pytest
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.skew import is_timed, motion_left, offsets_s, skew_covariances, unsure_motion
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan

SECOND = 10**9
PLACES = np.array([[3.0, 0.0], [0.0, 2.0], [-4.0, 0.0], [0.0, -1.0]])


def scan(increment_s: float = 0.2 / 360, step_rad: float = 2 * np.pi / 360, stamp_ns: int = SECOND) -> LaserScan:
    ranges = np.ones(360, np.float32)
    return LaserScan(stamp_ns, "laser", 0.0, 359 * step_rad, step_rad, increment_s, 0.2, 0.1, 9.0, ranges, ranges[:0])


def test_beams_are_as_late_as_they_are_on() -> None:
    found = offsets_s(scan(), SECOND, np.eye(4), PLACES)
    np.testing.assert_allclose(found, [0.0, 0.05, 0.1, 0.15], atol=1e-6)
    other_way = offsets_s(scan(step_rad=-2 * np.pi / 360), SECOND, np.eye(4), PLACES)
    np.testing.assert_allclose(other_way, [0.0, 0.15, 0.1, 0.05], atol=1e-6)
    np.testing.assert_allclose(offsets_s(scan(), SECOND - 10**8, np.eye(4), PLACES), found + 0.1, atol=1e-6)
    turned = np.array([[0.0, -1.0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(offsets_s(scan(), SECOND, turned, PLACES), [0.15, 0.0, 0.05, 0.1], atol=1e-6)
    unstamped = offsets_s(scan(stamp_ns=0), SECOND, np.eye(4), PLACES)
    np.testing.assert_allclose(unstamped, found - scan().duration_ns * 1e-9, atol=1e-6)


def test_without_times_a_beam_is_as_late_as_the_whole_scan() -> None:
    assert not is_timed(scan(increment_s=0.0))
    np.testing.assert_allclose(offsets_s(scan(increment_s=0.0), SECOND, np.eye(4), PLACES), 0.2)
    cloud = PointCloud2(SECOND, "laser", np.ones((2, 3), np.float32), np.array([-(10**8), 10**7]))
    np.testing.assert_allclose(offsets_s(cloud, SECOND, np.eye(4), PLACES), 0.1)


def test_driving_costs_ahead_and_turning_costs_across() -> None:
    driven = skew_covariances(PLACES, np.full(4, 0.1), np.diag([0.25, 0.0, 0.0]), np.zeros((3, 3)))
    np.testing.assert_allclose(driven, np.tile(np.diag([0.0025, 0.0]), (4, 1, 1)))
    turned = skew_covariances(PLACES, np.full(4, 0.1), np.diag([0.0, 0.0, 1.0]), np.zeros((3, 3)))
    np.testing.assert_allclose(turned[0], np.diag([0.0, 0.09]))
    np.testing.assert_allclose(turned[1], np.diag([0.04, 0.0]))
    np.testing.assert_allclose(skew_covariances(PLACES, np.zeros(4), np.eye(3), np.eye(3)), 0.0)


def test_wheels_that_slip_cost_as_their_walk_grows() -> None:
    slipped = skew_covariances(PLACES, np.array([0.1, 0.2, -0.1, 0.0]), np.zeros((3, 3)), np.diag([0.01, 0.0, 0.04]))
    expected = [np.diag([0.001, 0.036]), np.diag([0.034, 0.0]), np.diag([0.001, 0.064]), np.zeros((2, 2))]
    np.testing.assert_allclose(slipped, expected, atol=1e-15)


def test_what_is_left_of_the_motion_depends_on_what_tells_it() -> None:
    velocity, walk, config, none = np.array([0.3, 0.0, 1.0]), np.eye(3), ClusterConfig(), np.zeros((3, 3))
    untimed = scan(increment_s=0.0)
    for message, known, expected in [
        (scan(), velocity, (none, walk)),
        (untimed, velocity, (np.outer(velocity, velocity), none)),
        (scan(), None, (unsure_motion(config), none)),
    ]:
        np.testing.assert_array_equal(motion_left(message, known, walk, config), expected)


def test_what_is_assumed_of_the_robot_can_be_set() -> None:
    motion = unsure_motion(ClusterConfig(speed_mps=2.0, turn_dps=90.0))
    assert np.diag(motion) == pytest.approx([4.0, 4.0, (np.pi / 2) ** 2])
