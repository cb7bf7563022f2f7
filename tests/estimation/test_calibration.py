"""Sensor models from bundles alone: found where there is one to find, left plain where not."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.calibration import SensorModel, calibrate
from mcap_landmarks.estimation.pose import solve_poses

from tests.estimation.worlds import Array, Snapshots, pose_errors, thesis_like


def seen(count: int, sees: int = 4) -> Snapshots:
    return thesis_like(count, sees, 0.05, np.radians(0.5), seed=1)


def by_camera(world: Snapshots, offset_m: float = 0.08, depth: float = 1.0) -> Snapshots:
    return world._replace(range_m=offset_m + world.range_m * (1 - depth * (1 - np.cos(world.bearing_rad))))


def found(world: Snapshots) -> SensorModel:
    return calibrate(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance).model


def median_error_m(world: Snapshots, range_m: Array) -> float:
    solved = solve_poses(world.landmarks_xy, range_m, world.bearing_rad, world.covariance)
    return float(np.median(np.hypot(*pose_errors(solved.map_from_base, world.poses)[:, :2].T)))


def test_a_sensor_of_depths_is_found_and_undone() -> None:
    world = by_camera(seen(2000))
    model = found(world)
    assert model.depth == pytest.approx(1.0, abs=0.05)
    assert model.offset_m == pytest.approx(0.08, abs=0.04)
    np.testing.assert_allclose(model.scale, 1, rtol=0.05)
    corrected = median_error_m(world, model.distance_m(world.range_m, world.bearing_rad))
    assert corrected < 1.1 * median_error_m(seen(2000), seen(2000).range_m)
    assert corrected < 0.4 * median_error_m(world, world.range_m)


@pytest.mark.parametrize("count", [3, 2000])
def test_a_plain_sensor_stays_plain(count: int) -> None:
    model = found(seen(count))
    assert (model.offset_m, model.depth) == (0, 0)
    np.testing.assert_allclose(model.scale, 1, atol=0.35 if count == 3 else 0.03)


def test_sigmas_are_found() -> None:
    world = seen(2000)
    model = found(world._replace(covariance=world.covariance * np.outer([2, 0.5], [2, 0.5])))
    np.testing.assert_allclose(model.scale, [0.5, 2], rtol=0.05)


def test_wrong_sightings_hardly_matter() -> None:
    world = by_camera(seen(2000))
    world.range_m[::10, 1] += 2
    assert found(world).depth == pytest.approx(1.0, abs=0.1)


def test_what_is_masked_does_not_count() -> None:
    world = by_camera(seen(500, 5))
    mask = np.ones(world.range_m.shape, dtype=bool)
    mask[:, 4] = False
    spoilt = world.range_m.copy()
    spoilt[:, 4] = 99
    model = calibrate(world.landmarks_xy, spoilt, world.bearing_rad, world.covariance, mask=mask).model
    assert model.depth == pytest.approx(1.0, abs=0.1)
    nothing = calibrate(world.landmarks_xy, spoilt, world.bearing_rad, world.covariance, mask=np.zeros_like(mask)).model
    assert replace(nothing, scale=np.ones(0)).depth == 0


def test_derivatives_are_those_of_the_distance() -> None:
    model, ranges, bearings, step = SensorModel(0.1, 0.8), np.array([3.0, 9.0]), np.array([0.1, 0.5]), 1e-6
    here = model.distance_m(ranges, bearings)
    numeric = [
        (SensorModel(0.1 + step, 0.8).distance_m(ranges, bearings) - here) / step,
        (SensorModel(0.1, 0.8 + step).distance_m(ranges, bearings) - here) / step,
    ]
    np.testing.assert_allclose(model.derivatives(ranges, bearings), np.stack(numeric, axis=-1), rtol=1e-4)
