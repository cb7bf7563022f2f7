"""Points and their polar form, with covariances."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.estimation.polar import points_from_polar, polar_from_points


@given(
    st.tuples(*[st.floats(-20, 20)] * 2).filter(lambda p: np.hypot(*p) > 0.1),
    st.tuples(st.floats(0.01, 2), st.floats(0.01, 2), st.floats(-0.99, 0.99)),
)
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
    points, _ = points_from_polar([1.0, 2.0, 3.0], [0.0, np.pi / 2, np.pi], np.eye(2))
    np.testing.assert_allclose(points, [[1, 0], [0, 2], [-3, 0]], atol=1e-12)
    _, correlated = points_from_polar(2.0, 0.0, [[0.04, 0.01], [0.01, 0.09]])
    np.testing.assert_allclose(correlated, [[0.04, 0.02], [0.02, 0.36]])


def test_a_point_has_range_bearing_and_their_covariance() -> None:
    range_m, bearing, covariance = polar_from_points([0.0, 2.0], [[0.04, 0.01], [0.01, 0.09]])
    assert (float(range_m), float(bearing)) == (2.0, np.pi / 2)
    np.testing.assert_allclose(covariance, [[0.09, -0.005], [-0.005, 0.01]])


def test_a_point_at_the_base_has_no_bearing() -> None:
    assert np.isnan(polar_from_points([0.0, 0.0], np.eye(2))[2]).all()
