"""How far away a thing is by the camera alone, and how sure that is."""

import numpy as np
import pytest
from mcap_landmarks.classes import CLASSES
from mcap_landmarks.fusion.camera_range import UNKNOWN, CameraRange, floor_along, height_span, together
from mcap_landmarks.fusion.frustum import CloudView


def test_two_ranges_that_agree_are_surer_than_each() -> None:
    found = together(CameraRange(20.0, 2.0), CameraRange(21.0, 1.0))
    assert found.distance_m == pytest.approx(20.8)
    assert found.sigma_m == pytest.approx(np.sqrt(0.8))


def test_two_ranges_that_contradict_each_other_are_less_sure() -> None:
    found = together(CameraRange(20.0, 1.0), CameraRange(30.0, 1.0))
    assert found.distance_m == pytest.approx(25.0)
    assert found.sigma_m == pytest.approx(5.0)


def test_one_range_counts_alone_and_none_is_unknown() -> None:
    assert together(UNKNOWN, CameraRange(20.0, 2.0)) == CameraRange(20.0, 2.0)
    assert together(UNKNOWN, UNKNOWN).sigma_m == np.inf


def test_the_height_of_a_class_is_that_of_its_cuboid_or_between_its_limits() -> None:
    car, person = CLASSES["car"], CLASSES["person"]
    assert height_span(car.size, car.cuboid) == (1.56, 0.15)
    mean, sigma = height_span(person.size, person.cuboid)
    assert (mean, sigma) == (pytest.approx(1.725), pytest.approx(0.1125))


def test_the_ground_in_one_direction_is_that_of_the_points_there_also_across_the_half_turn() -> None:
    away = np.linspace(5.0, 45.0, 400)
    bearings = np.repeat([np.pi - 0.01, -np.pi + 0.01, 0.0, 0.5], 100)
    floors = np.select(
        [bearings > 3.0, bearings < -3.0], [0.4, 0.6], 2.0
    )  # half a metre on both sides of the half turn
    nothing = np.zeros((400, 2))
    view = CloudView(
        nothing, floors, floors, np.zeros(400, np.int32), nothing, np.tile(away[::4], 4), bearings, np.arange(400)
    )
    assert floor_along(view, np.pi) == (pytest.approx(0.5), pytest.approx(0.0))
    assert floor_along(view, -np.pi) == (pytest.approx(0.5), pytest.approx(0.0))
    assert floor_along(view, 0.0) == (pytest.approx(2.0), pytest.approx(0.0))
    assert floor_along(view, 1.5) == (0.0, 0.0)
