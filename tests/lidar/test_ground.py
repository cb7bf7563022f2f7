"""The ground of a cloud is found where it slopes, has kerbs, is hidden, or is not seen at all."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.ground import above_ground

from tests.lidar.clouds import AHEAD, ALL_AROUND, SIXTEEN, Solid, cloud

CAR = Solid(12.0, 2.0, 4.2, 1.7, 1.5)
WALL = Solid(25.0, -3.0, 0.4, 30.0, 4.0)
HERE = np.zeros(2)


# Before a wall 25 m away two of 16 rings are 10 m apart: what is between them may rise with the limit of slope.
@pytest.mark.parametrize(
    ("directions", "most_m"), [(AHEAD, 0.4), (ALL_AROUND, 0.4), (SIXTEEN, 0.9)], ids=["ahead", "all around", "16 rings"]
)
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, 0.0), (-0.06, 0.08)])
def test_a_slope_is_ground_and_what_stands_on_it_is_not(
    directions: Array, most_m: float, slope: tuple[float, float]
) -> None:
    points, owner = cloud([CAR, WALL], directions, slope)
    heights = above_ground(points, HERE)
    ground = heights[owner == -1]
    assert np.quantile(np.abs(ground), 0.95) < 0.12
    above = points[:, 2] - slope[0] * points[:, 0] - slope[1] * points[:, 1]
    standing = owner >= 0
    assert np.quantile(np.abs(heights[standing] - above[standing]), 0.95) < most_m


def test_a_kerb_is_lower_than_any_object() -> None:
    points, owner = cloud([Solid(20.0, 8.0, 40.0, 6.0, 0.14), CAR], ALL_AROUND)
    heights = above_ground(points, HERE)
    assert np.quantile(heights[owner < 1], 0.98) < 0.25
    assert np.quantile(heights[owner == 1], 0.5) > 0.5


def test_reflections_below_the_ground_do_not_lower_it() -> None:
    points, owner = cloud([CAR])
    patch = (owner == -1) & (np.abs(points[:, 0] - 8.5) < 0.5) & (np.abs(points[:, 1]) < 0.3)
    below = points[patch] - [0.0, 0.0, 1.0]
    heights = above_ground(np.concatenate([points, below]), HERE)[: len(points)]
    assert np.quantile(np.abs(heights[owner == -1]), 0.98) < 0.15


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_few_points_have_heights_all_the_same(count: int) -> None:
    points = np.random.default_rng(1).uniform(-20, 20, (count, 3))
    heights = above_ground(points, HERE)
    assert heights.shape == (count,)
    assert np.isfinite(heights).all()


def test_the_base_frame_may_lie_at_any_height() -> None:
    points, _ = cloud([CAR])
    moved = above_ground(points - [0.0, 0.0, 3.0], HERE)
    np.testing.assert_allclose(moved, above_ground(points, HERE), atol=0.02)
