"""Gauss-Newton's equations of range and bearing: as worked out by hand, and as differences of the cost."""

import numpy as np
import pytest
from mcap_landmarks.estimation.linearise import Linearised, Observations, Poses, choose, linearise, select
from mcap_landmarks.estimation.symmetric import Vector3

from tests.estimation.worlds import Array

POSES = Poses(np.array([1.0, -2.0]), np.array([2.0, 0.5]), np.cos([0.3, 2.5]), np.sin([0.3, 2.5]))


def observations() -> Observations:
    """Three noisy ones of each of the two poses, range and bearing correlated; the last one of the second is none."""
    rng = np.random.default_rng(1)
    landmark_x, landmark_y = rng.uniform(-8, 8, (2, 3, 2))
    dx, dy = landmark_x - POSES.x, landmark_y - POSES.y
    bearing = np.arctan2(dy, dx) - np.arctan2(POSES.sine, POSES.cosine) + rng.normal(0, 0.1, (3, 2))
    range_m = np.hypot(dx, dy) + rng.normal(0, 0.5, (3, 2))
    weights = np.full((3, 2), 4.0), np.full((3, 2), 3.0), np.full((3, 2), 25.0)
    for weight in weights:
        weight[2, 1] = 0
    return Observations(landmark_x, landmark_y, range_m, np.cos(bearing), np.sin(bearing), *weights)


def moved_by(x: float, y: float, turn: float) -> Poses:
    return POSES.moved(Vector3(*(np.full(2, value) for value in (x, y, turn))))


def test_a_pose_moves_in_the_map_and_turns_by_the_cayley_map() -> None:
    moved = moved_by(0.5, -1.0, 0.2)
    np.testing.assert_allclose(moved.x, [1.5, -1.5])
    np.testing.assert_allclose(moved.y, [1.0, -0.5])
    turn = 2 * np.arctan(0.1)
    np.testing.assert_allclose(np.arctan2(moved.sine, moved.cosine), [0.3 + turn, 2.5 + turn])
    np.testing.assert_allclose(np.hypot(moved.sine, moved.cosine), 1)


def test_one_observation_as_worked_out_by_hand() -> None:
    pose = Poses(*(np.array([value]) for value in (1.0, 2.0, 0.0, 1.0)))  # looks north
    bearing = 0.1
    one = [1.0, 6.0, 4.5, np.cos(bearing), np.sin(bearing), 4.0, 0.5, 9.0]
    at = linearise(Observations(*(np.array([[value]]) for value in one)), pose, None)
    # Range 0.5 too long, bearing 0.1 too far left.
    chi2 = 4 * 0.25 + 2 * 0.5 * 0.05 + 9 * 0.01
    assert at.chi2[0, 0] == pytest.approx(chi2)
    assert at.cost[0] == pytest.approx(chi2)
    by_range, by_bearing = 4 * 0.5 + 0.5 * 0.1, 0.5 * 0.5 + 9 * 0.1
    np.testing.assert_allclose(np.array(at.right)[:, 0], [by_bearing / 4, -by_range, -by_bearing])
    np.testing.assert_allclose(np.array(at.information)[:, 0], [9 / 16, -0.5 / 4, 4.0, -9 / 4, 0.5, 9.0], atol=1e-12)


def test_no_weight_is_no_observation() -> None:
    whole, without = observations(), observations()
    for name in ("landmark_x", "range_m"):
        getattr(without, name)[2, 1] = 7.0
    for ours, other in zip(flat(linearise(whole, POSES, 3.0)), flat(linearise(without, POSES, 3.0)), strict=True):
        np.testing.assert_array_equal(ours[..., 1], other[..., 1])


def flat(at: Linearised) -> list[Array]:
    return [at.cost, *at.right, *at.information]


@pytest.mark.parametrize("robust_dof", [None, 3.0])
def test_the_right_hand_side_is_half_the_costs_fall(robust_dof: float | None) -> None:
    observed, step = observations(), 1e-6
    at = linearise(observed, POSES, robust_dof)
    for axis in range(3):
        way = np.eye(3)[axis] * step
        fall = (
            linearise(observed, moved_by(*-way), robust_dof).cost - linearise(observed, moved_by(*way), robust_dof).cost
        ) / (4 * step)
        np.testing.assert_allclose(at.right[axis], fall, rtol=1e-5, atol=1e-7)


def information(observed: Observations, robust_dof: float | None, *, newton: bool) -> Array:
    """Matrices (2, 3, 3)."""
    m = linearise(observed, POSES, robust_dof, newton=newton).information
    return np.array([[m.xx, m.xy, m.xt], [m.xy, m.yy, m.yt], [m.xt, m.yt, m.tt]]).transpose(2, 0, 1)


def residual_derivatives(observed: Observations) -> Array:
    """Derivatives (2, 3, 2, 3) of the predicted range and bearing of each observation by its pose, by differences."""
    step, columns = 1e-6, []
    for axis in range(3):
        pair = []
        for sign in (1, -1):
            p = moved_by(*(np.eye(3)[axis] * step * sign))
            dx, dy = observed.landmark_x - p.x, observed.landmark_y - p.y
            pair.append(np.stack([np.hypot(dx, dy), np.arctan2(dy, dx) - np.arctan2(p.sine, p.cosine)]))
        columns.append((pair[0] - pair[1]) / (2 * step))
    return np.array(columns).transpose(3, 2, 1, 0)


def weight_matrices(observed: Observations) -> Array:
    """(2, 3, 2, 2)."""
    rr, rb, bb = observed.weight_rr, observed.weight_rb, observed.weight_bb
    return np.array([[rr, rb], [rb, bb]]).transpose(3, 2, 0, 1)


def test_the_information_is_the_weighted_one_for_covariances() -> None:
    observed = observations()
    by_pose, weight = residual_derivatives(observed), weight_matrices(observed)
    left = 3.0 / (3.0 + linearise(observed, POSES, 3.0).chi2.T)
    for dof, share in ((None, np.ones((2, 3))), (3.0, left)):
        expected = np.einsum("bk,bkri,bkrs,bksj->bij", share, by_pose, weight, by_pose)
        np.testing.assert_allclose(information(observed, dof, newton=False), expected, rtol=1e-5, atol=1e-6)


def test_the_information_for_steps_knows_how_the_loss_bends() -> None:
    """Less outer products of the weighted residuals: Triggs's correction."""
    observed, dof = observations(), 30.0
    by_pose, weight = residual_derivatives(observed), weight_matrices(observed)
    dx, dy = observed.landmark_x - POSES.x, observed.landmark_y - POSES.y
    bearing = np.arctan2(observed.direction_y, observed.direction_x)
    off = bearing - (np.arctan2(dy, dx) - np.arctan2(POSES.sine, POSES.cosine))
    miss = np.stack([observed.range_m - np.hypot(dx, dy), (off + np.pi) % (2 * np.pi) - np.pi], axis=-1).transpose(
        1, 0, 2
    )
    pulled = np.einsum("bkrs,bks->bkr", weight, miss)
    share = dof / (dof + np.einsum("bkr,bkr->bk", miss, pulled))
    expected = information(observed, dof, newton=False) - np.einsum(
        "bk,bkr,bks,bkri,bksj->bij", 2 * share**2 / dof, pulled, pulled, by_pose, by_pose
    )
    np.testing.assert_allclose(information(observed, dof, newton=True), expected, rtol=1e-4, atol=1e-5)


def test_a_pose_on_top_of_a_landmark_stays_finite() -> None:
    on_top = observations()
    on_top.landmark_x[0, 0], on_top.landmark_y[0, 0] = POSES.x[0], POSES.y[0]
    assert all(np.isfinite(part).all() for part in flat(linearise(on_top, POSES, 3.0)))


def test_columns_are_selected_and_chosen_at_every_depth() -> None:
    first, second = linearise(observations(), POSES, None), linearise(observations(), moved_by(1.0, 0.0, 0.0), None)
    one = select(first, np.array([False, True]))
    assert one.cost.tolist() == [first.cost[1]]
    assert one.information.yy.tolist() == [first.information.yy[1]]
    np.testing.assert_array_equal(one.chi2, first.chi2[:, 1:])
    mixed = choose(np.array([True, False]), first, second)
    assert mixed.cost.tolist() == [first.cost[0], second.cost[1]]
    assert mixed.right.t.tolist() == [first.right.t[0], second.right.t[1]]
