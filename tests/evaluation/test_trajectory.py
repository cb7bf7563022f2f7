"""Which pose belongs to which in time."""

import numpy as np
import pytest
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated, nearest

SECOND = 10**9


def straight(*seconds: float) -> Trajectory:
    """One metre a second along x, from x = 0 at time 0."""
    times = np.array([round(second * SECOND) for second in seconds], dtype=np.int64)
    return Trajectory.of(times, np.column_stack([times / SECOND, np.zeros(len(times)), np.zeros(len(times))]))


def test_times_are_sorted_and_each_stays_once() -> None:
    trajectory = Trajectory.of(np.array([5, 3, 5]), np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0]]))
    assert trajectory.time_ns.tolist() == [3, 5]
    assert trajectory.poses[:, 0].tolist() == [2, 1]
    assert np.isnan(trajectory.covariances).all()


def test_interpolation_neither_extrapolates_nor_bridges_gaps() -> None:
    reference = straight(1.0, 1.4, 2.0, 2.3)
    asked = straight(0.999, 1.0, 1.1, 1.4, 1.7, 2.0, 2.2, 2.3, 2.301)
    rows, poses = interpolated(asked, reference, SECOND // 2)
    assert rows.tolist() == [1, 2, 3, 5, 6, 7]
    np.testing.assert_allclose(poses[:, 0], [1.0, 1.1, 1.4, 2.0, 2.2, 2.3], atol=1e-12)


def test_interpolation_follows_the_arc() -> None:
    reference = Trajectory.of(np.array([0, 100]), np.array([[0.0, 0, 0], [1, 1, np.pi / 2]]))
    _, poses = interpolated(straight(50 / SECOND), reference, 100)
    np.testing.assert_allclose(poses[0], [np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), np.pi / 4], atol=1e-12)


def test_a_reference_of_one_pose_serves_its_own_time() -> None:
    rows, poses = interpolated(straight(1, 2, 3), straight(2), SECOND)
    assert rows.tolist() == [1]
    assert poses[0, 0] == 2
    assert not len(interpolated(straight(1), straight(), SECOND).estimate)
    assert not len(interpolated(straight(), straight(1), SECOND).estimate)


@pytest.mark.parametrize(("limit_s", "found"), [(0.02, [0, 1, 2]), (0.009, [1, 2]), (0.001, [1])])
def test_nearest_takes_the_closest_within_its_limit(limit_s: float, found: list[int]) -> None:
    reference = straight(1.0, 1.02, 2.0, 3.0)
    rows, poses = nearest(straight(1.01, 2.0, 2.995), reference, round(limit_s * SECOND))
    assert rows.tolist() == found
    assert poses[:, 0].tolist() == [[1.0, 2.0, 3.0][row] for row in found]


def test_nearest_goes_from_the_shorter_to_the_longer() -> None:
    rows, poses = nearest(straight(1.0, 1.004, 1.008, 5.0), straight(1.005, 1.007), 10**7)
    assert rows.tolist() == [1, 2]
    assert poses[:, 0].tolist() == [1.005, 1.007]
    assert not len(nearest(straight(1.0), straight(), 10**7).estimate)
