"""The solver's parts against numpy, against themselves and against drawn samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks.estimation import procrustes, robust
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.estimation.polar import points_from_polar, polar_from_points
from mcap_landmarks.estimation.symmetric import Symmetric3, Vector3, factor3, inverse2, inverse3, solve3
from mcap_landmarks.estimation.thesis import solve_position

from tests.estimation.worlds import Array


def symmetric(matrices: Array) -> Symmetric3:
    pairs = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
    return Symmetric3(*(matrices[:, i, j] for i, j in pairs))


def test_three_by_three_as_numpy_has_it() -> None:
    root = np.random.default_rng(0).normal(size=(200, 3, 5))
    matrices = root @ root.swapaxes(1, 2)
    right = np.random.default_rng(1).normal(size=(200, 3))
    factor = factor3(symmetric(matrices))
    assert factor.regular.all()
    np.testing.assert_allclose(inverse3(factor), np.linalg.inv(matrices), rtol=1e-6, atol=1e-8)
    solved = np.stack(solve3(factor, Vector3(*right.T)), axis=-1)
    np.testing.assert_allclose(solved, np.linalg.solve(matrices, right[..., None])[..., 0], rtol=1e-6, atol=1e-8)
    damped = matrices + 0.5 * matrices * np.eye(3)
    np.testing.assert_allclose(inverse3(factor3(symmetric(matrices), 0.5)), np.linalg.inv(damped), rtol=1e-8, atol=1e-9)


def test_singular_matrices_solve_to_zero_and_invert_to_infinity() -> None:
    matrices = np.stack([np.zeros((3, 3)), np.ones((3, 3)), np.diag([1.0, 0, 1]), np.eye(3)])
    factor = factor3(symmetric(matrices))
    assert factor.regular.tolist() == [False, False, False, True]
    step = np.stack(solve3(factor, Vector3(*np.ones((3, 4)))), axis=-1)
    np.testing.assert_array_equal(step, [[0] * 3] * 3 + [[1] * 3])
    assert np.isinf(np.diagonal(inverse3(factor)[:3], axis1=1, axis2=2)).all()


def test_two_by_two_inverses_are_zero_where_there_is_none() -> None:
    matrices = np.array([[[2.0, 1], [1, 3]], [[1, 2], [2, 1]], [[0, 0], [0, 0]], [[-1, 0], [0, -1]]])
    xx, xy, yy = inverse2(matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1])
    np.testing.assert_allclose([xx[0], xy[0], yy[0]], np.linalg.inv(matrices[0])[[0, 0, 1], [0, 1, 1]])
    assert not np.any([xx[1:], xy[1:], yy[1:]])


@given(
    st.tuples(*[st.floats(-20, 20)] * 2).filter(lambda p: np.hypot(*p) > 0.1),
    st.tuples(st.floats(0.01, 2), st.floats(0.01, 2), st.floats(-0.99, 0.99)),
)
@settings(deadline=None, derandomize=True)
def test_points_and_polar_form_are_inverse(point: tuple[float, float], spread: tuple[float, float, float]) -> None:
    sx, sy, correlation = spread
    covariance = np.array([[sx**2, sx * sy * correlation], [sx * sy * correlation, sy**2]])
    back, back_covariance = points_from_polar(*polar_from_points(point, covariance))
    np.testing.assert_allclose(back, point, atol=1e-12)
    np.testing.assert_allclose(back_covariance, covariance, rtol=1e-6, atol=1e-12)


def test_polar_sigmas_become_a_cloud_across_the_line_of_sight() -> None:
    point, covariance = points_from_polar(10.0, np.pi / 2, np.diag([0.12**2, 0.03**2]))
    np.testing.assert_allclose(point, [0, 10], atol=1e-12)
    np.testing.assert_allclose(covariance, np.diag([0.3**2, 0.12**2]), atol=1e-12)


def test_a_point_at_the_base_has_no_bearing() -> None:
    assert np.isnan(polar_from_points([0.0, 0.0], np.eye(2))[2]).all()


@pytest.mark.parametrize(("dof", "leverage"), [(3.0, 0.0), (3.0, 0.5), (10.0, 0.2)])
def test_student_covariance_factor_is_the_sandwich_of_drawn_noise(dof: float, leverage: float) -> None:
    noise = np.random.default_rng(0).normal(size=(400_000, 2))
    chi2 = (noise**2).sum(axis=1)
    weight = robust.student_weight(chi2, dof)
    slope = (weight - 2 * weight**2 / dof * noise[:, 0] ** 2).mean()  # derivative of weight * noise, along an axis
    spread = (weight**2 * noise[:, 0] ** 2).mean()
    seen = robust.student_weight(chi2 * (1 - leverage), dof).mean()
    assert robust.student_covariance_factor(dof, leverage) == pytest.approx(spread / slope**2 * seen, rel=0.01)


def test_student_loss_bends_as_its_weight_and_curvature_say() -> None:
    chi2, step = np.array([0.0, 0.5, 1.0]), 1e-6
    slope = (robust.student_loss(chi2 + step, 3.0) - robust.student_loss(chi2, 3.0)) / step
    weight = robust.student_weight(chi2, 3.0)
    np.testing.assert_allclose(slope, weight, rtol=1e-5)
    np.testing.assert_allclose(robust.student_curvature(chi2, weight, 3.0) * chi2 < weight, True)
    far = np.array([1e6])
    bent = robust.student_weight(far, 3.0)
    np.testing.assert_allclose(robust.student_curvature(far, bent, 3.0) * far, 0.9 * bent)


def test_procrustes_without_weights_stays_finite() -> None:
    zero = np.zeros((3, 1))
    x, y, cosine, sine = procrustes.fit(zero, zero, zero, zero, zero)
    assert [x[0], y[0], cosine[0], sine[0]] == [0, 0, 1, 0]


def test_the_thesiss_solver_finds_the_position_or_its_mirror_image() -> None:
    landmarks, position = np.array([[0.0, 0.0], [5.0, 0.01], [10.0, 0.0]]), np.array([4.0, 3.0])
    ranges = np.linalg.norm(landmarks - position, axis=1)
    np.testing.assert_allclose(solve_position(landmarks, ranges, (4.0, 2.0)).position_xy, position, atol=1e-6)
    assert solve_position(landmarks, ranges, (4.0, -2.0)).position_xy[1] < -2.9


def test_a_robot_that_stands_for_long_stays_where_it_is() -> None:
    still = Motions(np.zeros((5000, 3)), np.zeros(5000), np.zeros(5000))
    covariances = motion_covariance(still, OdometryNoise())
    assert (np.linalg.eigvalsh(covariances) > 0).all()
    assert np.sqrt(covariances.sum(axis=0).diagonal()).max() < 1e-3
