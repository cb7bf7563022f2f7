"""One log's part of the graph: what is in its first poses, where its points lie, and how its factors weigh."""

import numpy as np
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.mapping.log_graph import LandmarkObservations, LogNoise, graph_of

NOISE = OdometryNoise(0.1, 0.2, 0.3)
LOG = LandmarkObservations(
    np.array([1.0, 2.0, 0.0]),
    Motions(
        np.array([[1.0, 0.1, 0.2], [0.5, 0.0, -0.4], [2.0, 0.3, 0.1]]),
        np.array([1.1, 0.6, 2.2]),
        np.array([0.2, 0.4, 0.1]),
    ),
    np.array([0, 0, 2, 3]),
    np.array([7, 4, 7, 9]),
    np.array([2.0, 3.0, 4.0, 5.0]),
    np.array([0.0, np.pi / 2, -0.2, 0.1]),
    np.array([[[0.04, 0.001], [0.001, 0.01]]] * 4),
)


def test_the_first_poses_have_their_motions_and_observations() -> None:
    assert len(LOG) == 4
    first = LOG.first(3)
    assert len(first) == 3
    np.testing.assert_array_equal(first.start, LOG.start)
    for ours, whole in zip(
        (first.motions.relative, first.motions.distance_m, first.motions.turn_rad),
        (LOG.motions.relative, LOG.motions.distance_m, LOG.motions.turn_rad),
        strict=True,
    ):
        np.testing.assert_array_equal(ours, whole[:2])
    for name in ("pose", "landmark", "range_m", "bearing_rad", "covariance"):
        np.testing.assert_array_equal(getattr(first, name), getattr(LOG, name)[:3])
    assert LOG.first(1).landmark.tolist() == [7, 4]
    assert len(LOG.first(4).pose) == 4


def test_points_lie_where_the_poses_see_them() -> None:
    poses = np.array([[1.0, 2.0, np.pi / 2], [0.0, 0.0, 0.0], [0.0, 0.0, 0.2], [1.0, 1.0, -0.1]])
    expected = [[1.0, 4.0], [-2.0, 2.0], [4.0, 0.0], [6.0, 1.0]]
    np.testing.assert_allclose(LOG.points_xy(poses), expected, atol=1e-12)


def test_a_points_variance_is_that_of_range_and_across_it() -> None:
    np.testing.assert_allclose(LOG.variance(), 0.04 + LOG.range_m**2 * 0.01)


def test_observations_that_err_alike_together_weigh_as_one() -> None:
    """Of three that are wholly alike each has thrice the variance, of three that are not each its own."""
    noise = LogNoise(NOISE, np.array([2.0, 3.0]), np.array([1.0, 0.0]), np.array([3, 3, 3, 1]))
    np.testing.assert_allclose(noise.sigma_scale(), [[2 * 3**0.5, 3.0]] * 3 + [[2.0, 3.0]])
    half = LogNoise(NOISE, np.ones(2), np.array([0.5, 0.25]), np.array([5]))
    np.testing.assert_allclose(half.sigma_scale() ** 2, [[3.0, 2.0]])


def test_factors_whiten_what_was_observed_and_moved() -> None:
    noise = LogNoise(NOISE, np.array([2.0, 3.0]), np.array([1.0, 0.0]), np.array([4, 1, 1, 1]))
    graph = graph_of(LOG, np.array([1, 0, 1, 2]), noise)
    assert graph.observation_pose.tolist() == [0, 0, 2, 3]
    assert graph.observation_landmark.tolist() == [1, 0, 1, 2]
    np.testing.assert_array_equal(graph.range_m, LOG.range_m)
    np.testing.assert_array_equal(graph.bearing_rad, LOG.bearing_rad)
    scaled = [[16 * 0.04, 12 * 0.001], [12 * 0.001, 9 * 0.01]]
    plain = [[4 * 0.04, 6 * 0.001], [6 * 0.001, 9 * 0.01]]
    for root, covariance in zip(graph.observation_root, [scaled, plain, plain, plain], strict=True):
        np.testing.assert_allclose(root @ covariance @ root.T, np.eye(2), atol=1e-9)
    assert graph.motion_pose.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(graph.motion, LOG.motions.relative)
    for root, covariance in zip(graph.motion_root, motion_covariance(LOG.motions, NOISE), strict=True):
        np.testing.assert_allclose(root @ covariance @ root.T, np.eye(3), atol=1e-9)
    # The first residual is the heading's alone.
    np.testing.assert_array_equal(graph.motion_root[:, 0, :2], 0)
    assert (graph.motion_root[:, 0, 2] > 0).all()
    assert len(graph.prior_landmark) == 0
