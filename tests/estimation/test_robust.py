"""Student-t weights: their loss, how it bends, and what they do to a covariance."""

import numpy as np
import pytest
from mcap_landmarks.estimation import robust


def test_weights_fall_with_the_distance() -> None:
    np.testing.assert_allclose(robust.student_weight(np.array([0.0, 3.0, 9.0, 297.0]), 3.0), [1, 0.5, 0.25, 0.01])


def test_loss_grows_as_its_weight_says() -> None:
    chi2, step = np.array([0.0, 0.5, 20.0]), 1e-6
    slope = (robust.student_loss(chi2 + step, 3.0) - robust.student_loss(chi2, 3.0)) / step
    np.testing.assert_allclose(slope, robust.student_weight(chi2, 3.0), rtol=1e-5)
    assert robust.student_loss(np.array([0.0, 3.0]), 3.0).tolist() == pytest.approx([0.0, 3 * np.log(2)])


def test_the_correction_is_the_slope_of_the_weight_and_leaves_a_tenth() -> None:
    chi2, step = np.array([0.1, 0.5]), 1e-6
    weight = robust.student_weight(chi2, 3.0)
    slope = (robust.student_weight(chi2 + step, 3.0) - weight) / step
    np.testing.assert_allclose(robust.student_curvature(chi2, weight, 3.0), -2 * slope, rtol=1e-4)
    far = np.array([9.0, 1e6])
    bent = robust.student_weight(far, 3.0)
    np.testing.assert_allclose(robust.student_curvature(far, bent, 3.0) * far, 0.9 * bent)
    assert robust.student_curvature(np.zeros(1), np.ones(1), 3.0).tolist() == pytest.approx([2 / 3])


@pytest.mark.parametrize(("dof", "leverage"), [(3.0, 0.0), (3.0, 0.5), (10.0, 0.2)])
def test_the_covariance_factor_is_the_sandwich_of_drawn_noise(dof: float, leverage: float) -> None:
    noise = np.random.default_rng(0).normal(size=(400_000, 2))
    chi2 = (noise**2).sum(axis=1)
    weight = robust.student_weight(chi2, dof)
    slope = (weight - 2 * weight**2 / dof * noise[:, 0] ** 2).mean()  # derivative of weight * noise, along an axis
    spread = (weight**2 * noise[:, 0] ** 2).mean()
    seen = robust.student_weight(chi2 * (1 - leverage), dof).mean()
    assert robust.student_covariance_factor(dof, leverage) == pytest.approx(spread / slope**2 * seen, rel=0.01)


def test_hardly_robust_weights_leave_covariances_as_they_are() -> None:
    assert robust.student_covariance_factor(1e9, 0.3) == pytest.approx(1, abs=1e-6)
