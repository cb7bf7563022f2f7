"""The pose solver: exact without noise, at the bound with it, robust when asked, and calm when nothing can be told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks.estimation.pose import position_sigma, solve_poses
from mcap_landmarks.geometry import se2

from tests.estimation.worlds import Array, nees, pose_errors, thesis_like

NOISE = np.diag([0.02**2, np.radians(0.3) ** 2])
SQUARE = np.array([[4.0, 1.0], [5.0, -1.0], [7.0, 2.0], [9.0, -3.0]])


def sight(pose: Array, landmarks: Array) -> tuple[Array, Array]:
    points = se2.transform_points(se2.inverse(pose), landmarks)
    return np.hypot(points[..., 0], points[..., 1]), np.arctan2(points[..., 1], points[..., 0])


coordinate = st.floats(-50, 50)
poses = st.tuples(coordinate, coordinate, st.floats(-3.1, 3.1)).map(np.array)


@given(pose=poses, landmarks=st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=6, unique=True))
@settings(max_examples=40)
def test_without_noise_the_pose_is_exact(pose: Array, landmarks: list[tuple[float, float]]) -> None:
    xy = np.array(landmarks)
    spread = np.linalg.norm(xy - xy.mean(axis=0), axis=1).max()
    nearest = np.linalg.norm(xy - pose[:2], axis=1).min()
    if spread < 0.1 or nearest < 0.1:
        return
    ranges, bearings = sight(pose, xy)
    solved = solve_poses(xy[None], ranges[None], bearings[None], NOISE)
    assert solved.converged[0]
    error = se2.between(pose, solved.map_from_base[0])
    np.testing.assert_allclose(error, 0, atol=1e-7)
    assert solved.chi2[0] < 1e-9


@given(move=poses)
@settings(max_examples=40)
def test_moving_the_map_moves_the_pose_and_turns_its_covariance(move: Array) -> None:
    world = thesis_like(1, 4, 0.05, 0.01, seed=5)
    here = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    moved = se2.transform_points(move, world.landmarks_xy)
    there = solve_poses(moved, world.range_m, world.bearing_rad, world.covariance)
    error = se2.between(se2.compose(move, here.map_from_base), there.map_from_base)
    np.testing.assert_allclose(error, 0, atol=1e-5)
    turn = np.eye(3)
    turn[:2, :2] = se2.rotation(move[2])
    np.testing.assert_allclose(there.covariance[0], turn @ here.covariance[0] @ turn.T, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("sigma_range_m", [0.01, 0.05])
@pytest.mark.parametrize("sigma_bearing_deg", [0.1, 0.3])
def test_reaches_the_cramer_rao_bound_and_says_so(sigma_range_m: float, sigma_bearing_deg: float) -> None:
    world = thesis_like(10_000, 3, sigma_range_m, np.radians(sigma_bearing_deg), seed=1)
    solved = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    assert solved.converged.all()
    errors = pose_errors(solved.map_from_base, world.poses)
    bound = world.crb()
    ratio = np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean() / np.trace(bound[:, :2, :2], axis1=1, axis2=2).mean())
    assert ratio == pytest.approx(1, abs=0.02)
    assert 0.95 <= nees(errors, solved.covariance) <= 1.05
    assert solved.chi2.mean() / solved.dof.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("seen", [3, 5, 10])
def test_robust_weights_keep_the_covariance_honest(seen: int) -> None:
    world = thesis_like(4_000, seen, 0.02, np.radians(0.3), seed=2)
    solved = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance, robust_dof=3)
    assert solved.converged.mean() > 0.999
    errors = pose_errors(solved.map_from_base, world.poses)[solved.converged]
    assert 0.95 <= nees(errors, solved.covariance[solved.converged]) <= 1.05


def test_robust_weights_shrug_off_a_wrong_range() -> None:
    world = thesis_like(2_000, 6, 0.02, np.radians(0.3), seed=3)
    world.range_m[:, 2] += 3
    given_up = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    robust = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance, robust_dof=3)
    plain_error = np.hypot(*pose_errors(given_up.map_from_base, world.poses)[:, :2].T)
    robust_error = np.hypot(*pose_errors(robust.map_from_base, world.poses)[:, :2].T)
    assert np.median(plain_error) > 0.3
    assert np.median(robust_error) < 0.08
    assert np.median(robust.weights[:, 2]) < 0.01
    assert np.median(np.delete(robust.weights, 2, axis=1)) > 0.5
    assert (robust.observation_chi2.argmax(axis=1) == 2).mean() > 0.97


def test_the_maps_own_covariance_is_part_of_the_poses() -> None:
    world = thesis_like(4_000, 4, 0.02, np.radians(0.3), seed=4)
    spread = np.array([[0.04, 0.02], [0.02, 0.02]])
    drawn = np.random.default_rng(4).multivariate_normal([0, 0], spread, world.range_m.shape)
    solved = solve_poses(
        world.landmarks_xy + drawn, world.range_m, world.bearing_rad, world.covariance, landmark_covariance=spread
    )
    assert 0.95 <= nees(pose_errors(solved.map_from_base, world.poses), solved.covariance) <= 1.05
    blind = solve_poses(world.landmarks_xy + drawn, world.range_m, world.bearing_rad, world.covariance)
    assert nees(pose_errors(blind.map_from_base, world.poses), blind.covariance) > 5


def test_what_is_masked_or_broken_does_not_count() -> None:
    pose = np.array([1.0, 2.0, 0.5])
    ranges, bearings = sight(pose, SQUARE)
    rows = 6
    landmarks, covariance = np.tile(SQUARE, (rows, 1, 1)), np.tile(NOISE, (rows, 4, 1, 1))
    ranges, bearings, mask = np.tile(ranges, (rows, 1)), np.tile(bearings, (rows, 1)), np.ones((rows, 4), bool)
    mask[0, 1] = False
    ranges[0, 1] = 99
    ranges[1, 1] = np.nan
    bearings[2, 1] = np.inf
    covariance[3, 1] = 0
    covariance[4, 1] = [[1, 2], [2, 1]]
    landmarks[5, 1] = np.nan
    solved = solve_poses(landmarks, ranges, bearings, covariance, mask=mask)
    fewer = solve_poses(*(np.delete(a, 1, axis=1) for a in (landmarks[:1], ranges[:1], bearings[:1], covariance[:1])))
    np.testing.assert_allclose(solved.map_from_base, np.tile(pose, (rows, 1)), atol=1e-7)
    np.testing.assert_allclose(solved.covariance, np.repeat(fewer.covariance, rows, axis=0), rtol=1e-9)
    assert (solved.weights[:, 1] == 0).all()
    assert (solved.dof == 3).all()


@pytest.mark.parametrize("robust_dof", [None, 3.0])
@pytest.mark.parametrize(
    "landmarks",
    [np.empty((0, 2)), [[3.0, 4.0]], [[3.0, 4.0], [3.0, 4.0]], [[0.0, 0.0]] * 3],
    ids=["none", "one", "twice the same", "on top of the robot"],
)
def test_open_poses_have_infinite_covariance(landmarks: list[list[float]], robust_dof: float | None) -> None:
    xy = np.array(landmarks, dtype=float)
    rng = np.random.default_rng(7)
    ranges, bearings = sight(np.zeros(3), xy) + rng.normal(0, 0.01, (2, len(xy)))
    solved = solve_poses(xy[None], np.abs(ranges)[None], bearings[None], NOISE, robust_dof=robust_dof)
    assert not solved.converged[0]
    assert np.isinf(position_sigma(solved.covariance)[0])
    assert np.isfinite(solved.map_from_base).all()
    assert not np.isnan(solved.covariance).any()


def test_weak_geometry_shows_in_the_covariance() -> None:
    xy = np.array([[10.0, 0.0], [10.0, 0.01]])
    ranges, bearings = sight(np.zeros(3), xy)
    solved = solve_poses(xy[None], ranges[None], bearings[None], NOISE)
    assert position_sigma(solved.covariance)[0] > 10


def test_position_sigma_is_the_largest_in_any_direction() -> None:
    covariance = np.diag([0.04, 0.01, 1.0])
    turn = np.eye(3)
    turn[:2, :2] = se2.rotation(0.7)
    assert position_sigma(turn @ covariance @ turn.T) == pytest.approx(0.2)


def test_a_batch_gives_what_single_problems_give() -> None:
    world = thesis_like(9_000, 3, 0.05, 0.01, seed=6)
    together = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    for row in (0, 4_321, 8_999):
        landmarks, ranges, bearings = world.landmarks_xy[[row]], world.range_m[[row]], world.bearing_rad[[row]]
        alone = solve_poses(landmarks, ranges, bearings, world.covariance)
        np.testing.assert_allclose(alone.map_from_base[0], together.map_from_base[row], atol=1e-9)
