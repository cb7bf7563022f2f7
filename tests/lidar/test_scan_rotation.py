"""Two scans tell how far the LiDAR turned, whatever it sees besides."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.scan_rotation import turn_between

from tests.lidar.rooms import FULL, POSTS, scan

FRONT = np.deg2rad(np.arange(-60.0, 60.0, 0.5))
NOWHERE = np.zeros(2)


@pytest.mark.parametrize("turn_deg", [-24.0, -3.3, 0.0, 0.4, 7.5, 30.0])
@pytest.mark.parametrize("angles", [FULL, FULL[::-1].copy(), FRONT], ids=["circle", "clockwise", "front"])
def test_a_turn(angles: Array, turn_deg: float) -> None:
    first, second = scan(angles, np.zeros(3)), scan(angles, np.array([0, 0, np.deg2rad(turn_deg)]))
    found = turn_between(first, second, angles, NOWHERE, 0.2)
    assert found is not None
    assert np.rad2deg(found.turned_rad) == pytest.approx(turn_deg, abs=0.35)


def test_a_step_beside_the_turn_and_a_noisy_lidar() -> None:
    rng = np.random.default_rng(1)
    pose = np.array([0.12, 0.03, np.deg2rad(6.0)])
    for room in ((4.0, 3.0), None):
        first, second = (scan(FULL, at, room) * rng.normal(1, 0.005, 360) for at in (np.zeros(3), pose))
        second[rng.random(360) < 0.05] = np.nan
        found = turn_between(first, second, FULL, pose[:2], 0.2)
        assert found is not None
        assert np.rad2deg(found.turned_rad) == pytest.approx(6.0, abs=0.7)


def test_along_a_wall_nothing_turns() -> None:
    wall = np.where(np.sin(FULL) > 0.2, 1.0 / np.maximum(np.sin(FULL), 0.2), np.inf)
    found = turn_between(wall, wall, FULL, np.array([0.08, 0.0]), 0.2)
    assert found is not None
    assert abs(np.rad2deg(found.turned_rad)) < 1.0


def test_the_moment_is_that_of_the_beams_that_tell() -> None:
    first, second = scan(FULL, np.zeros(3), None, POSTS[:1]), scan(FULL, np.array([0, 0, -0.2]), None, POSTS[:1])
    found = turn_between(first, second, FULL, NOWHERE, 0.2)
    assert found is not None
    bearing = np.arctan2(0.5, 2.0)
    assert found.first == pytest.approx(bearing / (2 * np.pi), abs=0.01)
    assert found.second == pytest.approx((bearing + 0.2) / (2 * np.pi), abs=0.01)


def test_what_cannot_be_matched_tells_nothing() -> None:
    nothing = np.full(360, np.inf)
    assert turn_between(nothing, nothing, FULL, NOWHERE, 0.2) is None
    assert turn_between(np.full(360, 2.0), np.full(360, 2.0), FULL, NOWHERE, 0.2) is None
    assert turn_between(scan(FULL, np.zeros(3)), scan(FRONT, np.zeros(3)), FULL, NOWHERE, 0.2) is None
    rng = np.random.default_rng(2)
    assert turn_between(rng.uniform(1, 5, 360), rng.uniform(1, 5, 360), FULL, NOWHERE, 0.2) is None
