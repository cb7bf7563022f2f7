"""Casting a grid of beams at triangles: what PyBullet's rays meet, one by one, is what it says."""

import numpy as np
import pytest
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.ring_caster import RingCaster
from mcap_landmarks_generator.ring_lidar import directions
from mcap_landmarks_generator.sensor_specs import RingLidarSpec
from mcap_landmarks_generator.world import Returns, World
from numpy.typing import NDArray

from tests.generator.conftest import StageText

SCENE = """\
objects = [
  { class = "facade", at = [0, 6], yaw_deg = -90, look = 1 },
  { class = "car", at = [6, -5], walk = [[-6, -5]], speed_mps = 2 },
  { class = "person", variant = "stride", at = [3, 1], walk = [[-3, 1]], speed_mps = 1 },
  { class = "tree", at = [-4, 2], look = 5 },
  { class = "bicycle", at = [1.2, -1.2], yaw_deg = 70, look = 2 },
  { class = "chair", at = [-1, -1.2], look = 3 },
  { class = "glass", at = [2, 3], yaw_deg = -75 },
  { class = "bank", at = [-3, -9], yaw_deg = 90 },
  { class = "kerb", at = [0, -2.6] },
]
robot = { start = [0, 0, 0] }
camera = { when = "never" }
trajectory = { waypoints = [{ at = [0, 0], stop_s = 0.1 }] }
"""
REACH_M = 30.0
Floats = NDArray[np.float64]


def turn(spec: RingLidarSpec, seed: int) -> tuple[Floats, Floats]:
    """Starts (B, 3) and directions (B, R, 3) of a turn while the robot drives, turns and pitches."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, spec.beams)[:, None]
    starts = np.array([0.0, 0.0, spec.height_m]) + share * [*rng.uniform(-0.3, 0.3, 2), 0.01]
    yaw, pitch = rng.uniform(-4, 4) + share * rng.uniform(-0.8, 0.8), 0.03 * np.sin(9 * share)
    x, y, z = np.moveaxis(directions(spec), -1, 0)
    x, z = np.cos(pitch) * x - np.sin(pitch) * z, np.sin(pitch) * x + np.cos(pitch) * z
    return starts, np.stack([np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y, z], axis=-1)


def both(staged: Staged, spec: RingLidarSpec, seed: int, glass_deg: float = 5.0) -> tuple[Returns, Returns]:
    starts, rays = turn(spec, seed)
    caster, time_s = RingCaster(staged.objects), float(seed)
    caster.returns(starts, rays, REACH_M, time_s=time_s + 1)  # and then everyone goes back
    with World(staged.objects, staged.start) as world:
        world.move_walkers(time_s)
        expected = world.returns(np.repeat(starts, spec.rings, axis=0), rays.reshape(-1, 3), REACH_M, glass_deg)
    return caster.returns(starts, rays, REACH_M, glass_deg, time_s), expected


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "spec",
    [
        RingLidarSpec(),
        RingLidarSpec(rings=5, lowest_deg=-60, highest_deg=60),
        RingLidarSpec(rings=1, lowest_deg=2, beams=3000),
    ],
    ids=["16 rings", "steep", "one ring"],
)
def test_it_meets_what_rays_of_pybullet_meet(stage_text: StageText, spec: RingLidarSpec, seed: int) -> None:
    found, expected = both(stage_text(SCENE), spec, seed)
    assert found.names == expected.names
    assert set(found.name_of) >= {found.names.index(name) for name in ("", "car", "facade", "person", "tree")}
    nowhere = np.isinf(found.distances_m) & np.isinf(expected.distances_m)
    here = np.isfinite(found.distances_m) & np.isfinite(expected.distances_m)
    apart = np.abs(found.distances_m[here] - expected.distances_m[here])
    same = nowhere.copy()
    same[here] = apart < 1e-3
    # PyBullet makes triangles a little larger than they are: beams that pass by an edge within that meet it there.
    assert np.count_nonzero(~same) <= 4
    assert np.median(apart) < 1e-9
    assert np.count_nonzero(same & (found.name_of != expected.name_of)) <= 2
    assert np.count_nonzero(same & (found.passed != expected.passed)) <= 4
    assert expected.passed.max() == 2
    same &= ~nowhere
    # On the edge of two triangles either one's normal will do.
    assert np.mean(np.abs(found.cosines - expected.cosines)[same] > 1e-6) < 0.01


def test_glass_stops_what_meets_it_straight_on(stage_text: StageText) -> None:
    spec = RingLidarSpec()
    (through, _), (solid, expected) = (both(stage_text(SCENE), spec, 0, glass_deg) for glass_deg in (5.0, 90.0))
    pane = solid.names.index("glass")
    assert np.count_nonzero(solid.name_of == pane) > 2 * np.count_nonzero(through.name_of == pane) > 0
    assert np.count_nonzero(solid.name_of != expected.name_of) <= 2


def test_a_world_without_objects_is_ground() -> None:
    returns = RingCaster(()).returns(*turn(RingLidarSpec(), 0), REACH_M)
    assert np.isfinite(returns.distances_m).mean() == pytest.approx(0.45, abs=0.05)
    assert not returns.name_of.any()
