"""Rectangles lie on the points that are seen, and go on where nothing is seen, as unsure as that is."""

import numpy as np
import pytest
from mcap_landmarks.classes import CLASSES, Cuboid
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.rectangles import BoxEdges, Rectangle, completed, hugging

from tests.lidar.clouds import Solid, cloud

CAR = CLASSES["car"].cuboid
HERE = np.zeros(2)


def seen(solid: Solid, seed: int = 0) -> Array:
    """The points (N, 2) of a solid, seen from the origin."""
    points, owner = cloud([solid], seed=seed)
    return points[(owner == 0) & (points[:, 2] > 0.25), :2]


def edges_of(solid: Solid, sigma_rad: float = 0.004) -> BoxEdges:
    shape = Rectangle(np.array([solid.x, solid.y]), solid.length_m, solid.width_m, solid.yaw_rad, np.eye(2))
    bearings = np.arctan2(*shape.corners.T[::-1])
    return BoxEdges(HERE, float(bearings.max()), float(bearings.min()), sigma_rad, (0.0, 0.0))


def off_parallel(yaw_rad: float, other_rad: float) -> float:
    """The angle between two lengths, which have no front."""
    return abs(float(wrap(2 * (yaw_rad - other_rad)))) / 2


@pytest.mark.parametrize("yaw_deg", [-80, -35, 0, 20, 45, 70])
def test_the_hugging_rectangle_follows_an_l(yaw_deg: float) -> None:
    solid = Solid(10.0, 4.0, 4.0, 1.8, 1.5, np.deg2rad(yaw_deg))
    points = seen(solid)
    (found,) = hugging([points])
    assert min(off_parallel(found.yaw_rad, solid.yaw_rad + turn) for turn in (0, np.pi / 2)) < np.deg2rad(5)
    assert found.holds(points, 0.1).mean() > 0.9  # a twentieth is trimmed at every end
    assert found.length_m < 4.3


def test_a_rear_goes_on_away_from_the_lidar() -> None:
    found = completed(
        seen(Solid(15.0, 0.0, 4.2, 1.74, 1.5)), HERE, _known(), edges_of(Solid(15.0, 0.0, 4.2, 1.74, 1.5))
    )
    np.testing.assert_allclose(found.centre_xy, [15.0, 0.0], atol=0.3)
    along, across = np.sqrt(found.covariance[0, 0]), np.sqrt(found.covariance[1, 1])
    assert along > 2 * across
    assert 0.1 < along < 0.6


def test_a_side_is_known_to_be_a_length() -> None:
    found = completed(seen(Solid(12.0, 7.0, 4.2, 1.74, 1.5)), HERE, _known())
    assert off_parallel(found.yaw_rad, 0.0) < np.deg2rad(6)
    np.testing.assert_allclose(found.centre_xy, [12.0, 7.0], atol=0.35)


def test_the_edges_of_a_box_tell_how_long_it_is() -> None:
    long_one = Solid(14.0, 6.0, 5.2, 1.8, 1.5, 0.9)
    rear = seen(long_one)
    only_rear = rear[rear[:, 0] < np.quantile(rear[:, 0], 0.5)]
    alone = completed(only_rear, HERE, _known())
    told = completed(only_rear, HERE, _known(), edges_of(long_one))
    off = [np.hypot(*(found.centre_xy - [14.0, 6.0])) for found in (alone, told)]
    assert off[1] < off[0]


def test_a_side_that_is_seen_is_not_the_far_one_whatever_the_box_says() -> None:
    """Of a car behind another one only the side towards the street is seen, and its box reaches over the street."""
    side = np.column_stack([np.linspace(39.2, 43.0, 24), 5.6 + 0.03 * np.sin(np.arange(24))])
    over_the_street = BoxEdges(HERE, np.arctan2(5.6, 39.2), np.arctan2(4.2, 43.0), 0.004, (0.0, 0.0))
    alone = completed(side, HERE, _known())
    assert alone.centre_xy[1] == pytest.approx(5.6 + 1.74 / 2, abs=0.15)
    assert completed(side, HERE, _known(), over_the_street).centre_xy[1] > 5.3


def test_where_something_hides_an_edge_a_car_may_go_on() -> None:
    """Of half a rear beside what stands before it nobody knows whether it is a rear or a side."""
    rear = seen(Solid(41.0, 1.0, 4.2, 1.74, 1.5))
    half, left_rad, right_rad = rear[rear[:, 1] < 1.0], np.arctan2(1.0, 38.9), np.arctan2(0.13, 38.9)
    shown, hidden = (
        completed(half, HERE, _known(), BoxEdges(HERE, left_rad, right_rad, 0.004, (slack_rad, 0.0)))
        for slack_rad in (0.0, 0.05)
    )
    assert hidden.centre_xy[1] > shown.centre_xy[1] + 0.2
    off = hidden.centre_xy - [41.0, 1.0]
    assert off @ np.linalg.solve(hidden.covariance, off) < 4.6  # 90 % of two degrees


def test_covariances_say_how_far_off_centres_are() -> None:
    rng, nees, errors = np.random.default_rng(5), [], []
    for i in range(60):
        size = np.array([4.2, 1.74]) + rng.normal(0, 1, 2) * [_known().length_m[1], _known().width_m[1]]
        away, bearing = rng.uniform(7, 30), rng.uniform(-0.7, 0.7)
        x, y = away * np.cos(bearing), away * np.sin(bearing)
        solid = Solid(x, y, size[0], size[1], 1.5, rng.uniform(-np.pi / 2, np.pi / 2))
        found = completed(seen(solid, i), HERE, _known(), edges_of(solid, 0.003))
        off = found.centre_xy - [x, y]
        errors.append(np.hypot(*off))
        nees.append(off @ np.linalg.solve(found.covariance, off) / 2)
    assert np.median(errors) < 0.2
    assert 0.3 < np.mean(nees) < 2.0


def test_corners_hold_what_is_in_them() -> None:
    shape = Rectangle(np.array([3.0, 1.0]), 4.0, 2.0, 0.5, np.eye(2))
    assert shape.holds(shape.corners, 1e-9).all()
    assert not shape.holds(shape.centre_xy + 1.01 * (shape.corners - shape.centre_xy), 0.0).any()


def _known() -> Cuboid:
    assert CAR is not None
    return CAR
