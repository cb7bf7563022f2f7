"""Pose problems as the solver takes them: what counts, how it weighs, where it starts."""

import numpy as np
import pytest
from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.estimation.problems import Problems

from tests.estimation.worlds import Array

LANDMARKS = np.array([[4.0, 1.0], [1.0, 5.0], [-3.0, 2.0]])
POSE = np.array([0.5, -0.5, 0.8])
NOISE = np.array([[0.04, 0.002], [0.002, 0.01]])
SPREAD = np.array([[0.09, 0.03], [0.03, 0.04]])


def exact() -> tuple[Array, Array]:
    d = LANDMARKS - POSE[:2]
    return np.hypot(d[:, 0], d[:, 1]), np.arctan2(d[:, 1], d[:, 0]) - POSE[2]


def problems(**given: object) -> Problems:
    range_m, bearing = exact()
    whole = {
        "landmarks_xy": LANDMARKS,
        "range_m": range_m[None],
        "bearing_rad": bearing[None],
        "covariance": NOISE,
        "landmark_covariance": None,
        "mask": None,
        **given,
    }
    return Problems.of(**whole)


def test_the_start_is_the_pose_where_all_is_exact() -> None:
    _, start, used = problems().prepare(slice(0, 1))
    assert used.all()
    np.testing.assert_allclose([start.x[0], start.y[0], np.arctan2(start.sine[0], start.cosine[0])], POSE)


def test_the_start_weighs_points_by_their_variance_in_all_directions() -> None:
    """Range's variance, bearing's times the squared range, and the map's; halfway between two poses, that decides."""
    range_m, bearing = np.array([[1.0, 1.0]]), np.array([[0.0, 0.0]])
    landmarks = np.array([[1.0, 0.0], [3.0, 0.0]])
    noise = np.array([np.diag([0.01, 0.02]), np.diag([0.02, 0.05])])
    of_map = np.array([np.diag([0.03, 0.04]), np.diag([0.0, 0.03])])
    given = Problems.of(landmarks, range_m, bearing, noise, of_map, None)
    _, start, _ = given.prepare(slice(0, 1))
    near, far = 1 / (0.01 + 0.02 + 0.03 + 0.04), 1 / (0.02 + 0.05 + 0.03)
    assert start.x[0] == pytest.approx((1 * near + 3 * far) / (near + far) - 1)
    further = Problems.of(landmarks, 2 * range_m, bearing, noise, None, None)
    _, start, _ = further.prepare(slice(0, 1))
    near, far = 1 / (0.01 + 4 * 0.02), 1 / (0.02 + 4 * 0.05)
    assert start.x[0] == pytest.approx((1 * near + 3 * far) / (near + far) - 2)


def test_observations_weigh_by_the_inverse_of_their_covariance() -> None:
    observed, _, _ = problems().prepare(slice(0, 1))
    expected = np.linalg.inv(NOISE)
    for weight, entry in ((observed.weight_rr, (0, 0)), (observed.weight_rb, (0, 1)), (observed.weight_bb, (1, 1))):
        np.testing.assert_allclose(weight[:, 0], expected[entry])


def test_the_maps_covariance_counts_as_seen_from_the_robot() -> None:
    observed, _, _ = problems(landmark_covariance=SPREAD).prepare(slice(0, 1))
    turned = np.array([[np.cos(POSE[2]), -np.sin(POSE[2])], [np.sin(POSE[2]), np.cos(POSE[2])]])
    local = (LANDMARKS - POSE[:2]) @ turned
    _, _, by_map = polar_from_points(local, turned.T @ SPREAD @ turned)
    expected = np.linalg.inv(NOISE + by_map)
    found = np.array([[observed.weight_rr, observed.weight_rb], [observed.weight_rb, observed.weight_bb]])[..., 0]
    np.testing.assert_allclose(found.transpose(2, 0, 1), expected, rtol=1e-9)


BROKEN = {
    "masked": {"mask": np.array([True, False, True])},
    "no range": {"range_m": np.array([[1.0, np.nan, 1.0]])},
    "endless bearing": {"bearing_rad": np.array([[0.0, np.inf, 0.0]])},
    "no landmark": {"landmarks_xy": np.array([[0.0, 0.0], [np.nan, 0.0], [1.0, 0.0]])},
    "no variance": {"covariance": np.array([NOISE, 0 * NOISE, NOISE])},
    "variance of range only": {"covariance": np.array([NOISE, np.diag([1.0, 0.0]), NOISE])},
    "variance of bearing only": {"covariance": np.array([NOISE, np.diag([0.0, 1.0]), NOISE])},
    "indefinite": {"covariance": np.array([NOISE, [[1.0, 2.0], [2.0, 1.0]], NOISE])},
    "endless variance": {"covariance": np.array([NOISE, np.diag([np.inf, 1.0]), NOISE])},
    "indefinite landmark": {"landmark_covariance": np.array([SPREAD, [[1.0, 2.0], [2.0, 1.0]], SPREAD])},
    "landmark of negative variance": {"landmark_covariance": np.array([SPREAD, np.diag([-0.1, 0.1]), SPREAD])},
}


@pytest.mark.parametrize("given", BROKEN.values(), ids=BROKEN)
def test_what_is_masked_or_broken_weighs_nothing(given: dict[str, Array]) -> None:
    with np.errstate(invalid="ignore"):
        observed, start, used = problems(**given).prepare(slice(0, 1))
    assert used[:, 0].tolist() == [True, False, True]
    for weight in (observed.weight_rr, observed.weight_rb, observed.weight_bb):
        assert weight[1, 0] == 0
    assert all(np.isfinite(part).all() for part in (*observed, *start))


def test_landmarks_may_be_known_exactly_or_along_a_line() -> None:
    of_map = np.array([np.zeros((2, 2)), [[1.0, 1.0], [1.0, 1.0]], np.diag([0.5, 0.0])])
    _, _, used = problems(landmark_covariance=of_map).prepare(slice(0, 1))
    assert used.all()
