"""Sensor models from bundles alone: found where there is one to find, left plain where not."""

import numpy as np
import pytest
from mcap_landmarks.estimation.calibration import SensorModel, calibrate
from mcap_landmarks.estimation.pose import solve_poses

from tests.estimation.worlds import Array, Snapshots, pose_errors, thesis_like

PRIOR_SIGMA = np.array([0.05, 1.0])


def seen(count: int, sees: int = 4) -> Snapshots:
    return thesis_like(count, sees, 0.05, np.radians(0.5), seed=1)


def by_camera(world: Snapshots, offset_m: float = 0.08, depth: float = 1.0) -> Snapshots:
    return world._replace(range_m=offset_m + world.range_m * (1 - depth * (1 - np.cos(world.bearing_rad))))


def found(world: Snapshots) -> SensorModel:
    return calibrate(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance).model


def median_error_m(world: Snapshots, range_m: Array) -> float:
    solved = solve_poses(world.landmarks_xy, range_m, world.bearing_rad, world.covariance)
    return float(np.median(np.hypot(*pose_errors(solved.map_from_base, world.poses)[:, :2].T)))


def test_a_model_turns_measured_ranges_into_distances() -> None:
    model = SensorModel(offset_m=0.1, depth=0.5)
    np.testing.assert_allclose(model.distance_m([3.1, 4.1], [0.0, np.pi / 3]), [3.0, 4.0 / 0.75])
    assert SensorModel().distance_m(7.0, 1.0) == 7.0


def test_derivatives_are_those_of_the_distance() -> None:
    model, ranges, bearings, step = SensorModel(0.1, 0.8), np.array([3.0, 9.0]), np.array([0.1, 0.5]), 1e-6
    here = model.distance_m(ranges, bearings)
    numeric = [
        (SensorModel(0.1 + step, 0.8).distance_m(ranges, bearings) - here) / step,
        (SensorModel(0.1, 0.8 + step).distance_m(ranges, bearings) - here) / step,
    ]
    np.testing.assert_allclose(model.derivatives(ranges, bearings), np.stack(numeric, axis=-1), rtol=1e-4)


def test_a_sensor_of_depths_is_found_and_undone() -> None:
    world = by_camera(seen(600))
    model = found(world)
    assert model.depth == pytest.approx(1.0, abs=0.02)
    assert model.offset_m == pytest.approx(0.08, abs=0.02)
    np.testing.assert_allclose(model.scale, 1, rtol=0.06)
    corrected = median_error_m(world, model.distance_m(world.range_m, world.bearing_rad))
    assert corrected < 1.1 * median_error_m(seen(600), seen(600).range_m)
    assert corrected < 0.4 * median_error_m(world, world.range_m)


def cost(world: Snapshots, offset_m: float, depth: float, scale: Array, of_map: Array) -> float:
    """Robust cost of all bundles at their best poses, plus what the model's prior adds."""
    distance = SensorModel(offset_m, depth).distance_m(world.range_m, world.bearing_rad)
    noise = world.covariance * np.outer(scale, scale)
    solved = solve_poses(
        world.landmarks_xy, distance, world.bearing_rad, noise, landmark_covariance=of_map, robust_dof=3.0
    )
    return float(solved.cost.sum() + ((np.array([offset_m, depth]) / PRIOR_SIGMA) ** 2).sum())


@pytest.mark.parametrize("of_map", [np.zeros((2, 2)), np.diag([0.01, 0.002])], ids=["exact map", "map with errors"])
def test_the_model_is_where_the_cost_is_least(of_map: Array) -> None:
    world = by_camera(thesis_like(40, 4, 0.1, 0.02, seed=3))
    spread = np.broadcast_to(of_map, (*world.range_m.shape, 2, 2))
    covariance = np.broadcast_to(world.covariance, spread.shape)
    given = world.landmarks_xy, world.range_m, world.bearing_rad, covariance
    model = calibrate(*given, landmark_covariance=spread).model
    assert model.depth > 0.5
    at, scale = np.array([model.offset_m, model.depth]), model.scale
    least = cost(world, *at, scale, of_map)
    for step in ([0.05, 0.0], [-0.05, 0.0], [0.0, 0.05], [0.0, -0.05]):
        assert cost(world, *(at + step), scale, of_map) > least + 0.1
    if not of_map.any():  # a map's share is seen from the start poses, which move a bit with the model
        gentle = 1e-3
        slopes = [
            (cost(world, *(at + gentle * one), scale, of_map) - cost(world, *(at - gentle * one), scale, of_map))
            / (2 * gentle)
            for one in np.eye(2)
        ]
        np.testing.assert_allclose(slopes * PRIOR_SIGMA, 0, atol=0.2)


@pytest.mark.parametrize("count", [3, 600])
def test_a_plain_sensor_stays_plain(count: int) -> None:
    model = found(seen(count))
    assert (model.offset_m, model.depth) == (0, 0)
    np.testing.assert_allclose(model.scale, 1, atol=0.2 if count == 3 else 0.03)


@pytest.mark.parametrize(("count", "sigma_m", "is_told"), [(12, 0.3, False), (30, 0.5, True)])
def test_a_model_must_explain_enough_to_be_believed(count: int, sigma_m: float, is_told: bool) -> None:
    """It explains a chi-square of 16 in the first case, which noise does too, and of 40 in the second."""
    world = by_camera(thesis_like(count, 4, sigma_m, 0.05, seed=2), offset_m=0.0)
    assert (found(world).depth > 0.8) is is_told


def test_bundles_of_two_landmarks_tell_a_number_each() -> None:
    """Of the four of both ranges and bearings the pose takes three."""
    assert found(by_camera(seen(600, 2))).depth == pytest.approx(1.0, abs=0.05)


def test_sigmas_are_found() -> None:
    world = seen(600)
    model = found(world._replace(covariance=world.covariance * np.outer([2, 0.5], [2, 0.5])))
    np.testing.assert_allclose(model.scale, [0.5, 2], rtol=0.05)


def test_the_sigmas_of_a_few_bundles_stay_near_those_given() -> None:
    """As if ten residuals of either had agreed with them: a bundle of four has five to tell more."""
    world = seen(1)._replace(covariance=seen(1).covariance * 1e4)
    np.testing.assert_allclose(found(world).scale ** 2, [10 / 12.5, 10 / 12.5], atol=0.1)


def test_wrong_observations_hardly_matter() -> None:
    world = by_camera(seen(600))
    world.range_m[::10, 1] += 2
    assert found(world).depth == pytest.approx(1.0, abs=0.05)


def test_what_is_masked_does_not_count() -> None:
    world = by_camera(seen(200, 5))
    mask = np.ones(world.range_m.shape, dtype=bool)
    mask[:, 4] = False
    mask[100:, 1:] = False  # one landmark alone says nothing of the sensor
    spoilt = world.range_m.copy()
    spoilt[:, 4] = 99
    spoilt[100:, 0] = 55
    model = calibrate(world.landmarks_xy, spoilt, world.bearing_rad, world.covariance, mask=mask).model
    only = [a[:100, :4] for a in (world.landmarks_xy, world.range_m, world.bearing_rad)]
    kept = calibrate(*only, world.covariance).model
    assert model.depth == pytest.approx(kept.depth, rel=1e-6)
    np.testing.assert_allclose(model.scale, kept.scale, rtol=1e-6)
    nothing = calibrate(world.landmarks_xy, spoilt, world.bearing_rad, world.covariance, mask=np.zeros_like(mask))
    assert (nothing.model.depth, nothing.model.scale.tolist()) == (0, [1, 1])
