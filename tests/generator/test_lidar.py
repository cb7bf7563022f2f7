"""Scans against distances to the objects' sections that know nothing of PyBullet."""

from collections.abc import Iterator

import numpy as np
import pytest
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.history import History, rotate
from mcap_landmarks_generator.lidar import Lidar, beam_angles, cast, noisy
from mcap_landmarks_generator.odometry import true_poses
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M
from mcap_landmarks_generator.sensor_specs import LidarSpec
from mcap_landmarks_generator.world import World
from numpy.typing import NDArray

from tests.generator.conftest import StageText

Floats = NDArray[np.float64]

SCENE = """\
objects = [
  { class = "fire hydrant", at = [3.0, 0.4], look = 1 },
  { class = "box", at = [-0.5, 2.5], yaw_deg = 25.0, look = 2 },
]
[trajectory]
waypoints = [ { at = [0.0, 0.0], stop_s = 1.0 } ]
"""
# The sections of a hydrant and a box.
DISC_RADIUS_M = 0.15
BOX_HALF_M = np.array([0.225, 0.3])


@pytest.fixture
def staged(stage_text: StageText) -> Staged:
    return stage_text(SCENE)


def simulated(staged: Staged, steps: int, speed: float = 0.0, turn: float = 0.0) -> Iterator[tuple[World, History]]:
    """The world and the robot's past after some steps at given wheel speeds."""
    history = History()
    with World(staged.objects, staged.start) as world:
        history.append(world.robot.state(), standing=False)
        world.robot.drive(speed, turn)
        for _ in range(steps):
            world.step()
            history.append(world.robot.state(), standing=False)
        yield world, history


def to_disc(origins: Floats, directions: Floats, centre: Floats, radius_m: float) -> Floats:
    """Distance (N,) along rays to a disc, inf for none."""
    offset = origins - centre
    along = (offset * directions).sum(axis=1)
    inside = along**2 - (offset**2).sum(axis=1) + radius_m**2
    return np.where((inside >= 0) & (along < 0), -along - np.sqrt(np.maximum(inside, 0)), np.inf)


def to_box(origins: Floats, directions: Floats, centre: Floats, yaw_rad: float, half_m: Floats) -> Floats:
    """Distance (N,) along rays to a turned box, inf for none."""
    turn = np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]])
    start, ahead = (origins - centre) @ turn, directions @ turn
    with np.errstate(divide="ignore"):
        crossings = (np.stack([-half_m, half_m])[:, None] - start) / ahead
    enter, leave = crossings.min(axis=0).max(axis=1), crossings.max(axis=0).min(axis=1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


def rays(history: History, spec: LidarSpec, times_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Origins and directions (N, 2) of the beams in the world, from the true poses."""
    poses = true_poses(history, times_ns)
    angles = beam_angles(spec) + poses[:, 2]
    offset = SCAN_IN_BASE_M[0] * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    return poses[:, :2] + offset, np.stack([np.cos(angles), np.sin(angles)], axis=1)


def analytic(origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    disc = to_disc(origins, directions, np.array([3.0, 0.4]), DISC_RADIUS_M)
    box = to_box(origins, directions, np.array([-0.5, 2.5]), np.deg2rad(25.0), BOX_HALF_M)
    return disc, box


@pytest.mark.parametrize("part", ["disc", "box"])
def test_ranges_keep_to_their_noise(staged: Staged, part: str) -> None:
    """99 % within 3 sigma, bias below 0.3 sigma, against the analytic distance to a disc and to a box."""
    spec = LidarSpec(beams=1440, dropout=0.0)
    times = np.zeros(spec.beams, np.int64)
    for world, history in simulated(staged, 50):
        expected = dict(zip(("disc", "box"), analytic(*rays(history, spec, times)), strict=True))[part]
        distances = cast(world, history, spec, times).distances_m
    seen = np.isfinite(expected)
    errors = np.concatenate(
        [noisy(distances, spec, draws(seed, Stream.SCAN))[seen] - expected[seen] for seed in range(60)]
    )
    assert len(errors) > 1000
    assert np.mean(np.abs(errors) < 3 * spec.sigma_m) >= 0.99
    assert abs(errors.mean()) < 0.3 * spec.sigma_m
    assert errors.std() == pytest.approx(spec.sigma_m, rel=0.1)


def test_beams_miss_what_the_sections_miss(staged: Staged) -> None:
    spec = LidarSpec(beams=1440)
    times = np.zeros(spec.beams, np.int64)
    for world, history in simulated(staged, 1):
        expected = np.minimum(*analytic(*rays(history, spec, times)))
        hit = np.isfinite(cast(world, history, spec, times).distances_m)
    assert np.count_nonzero(hit != np.isfinite(expected)) <= 1
    assert np.isfinite(expected).sum() > 50


@pytest.mark.parametrize("instantaneous", [False, True])
def test_each_beam_leaves_from_where_the_robot_is_then(staged: Staged, instantaneous: bool) -> None:
    spec = LidarSpec(
        beams=1440, rate_hz=4, instantaneous=instantaneous, sigma_m=0.0, dropout=0.0, phase_s=0.2, jitter_s=0.0
    )
    for world, history in simulated(staged, 120, speed=0.2, turn=1.5):
        stamped = next(Lidar(spec, seed=0, start_ns=10**18).measure(history, world))
        scan = stamped.message
    assert isinstance(scan, LaserScan)
    assert scan.stamp_ns == 10**18 + 200_000_000
    assert (scan.time_increment_s == 0) == instantaneous
    offsets = np.rint(np.arange(spec.beams) * scan.time_increment_s * 1e9).astype(np.int64)
    expected = np.minimum(*analytic(*rays(history, spec, 200_000_000 + offsets)))
    both = np.isfinite(scan.ranges_m) & np.isfinite(expected)
    assert np.count_nonzero(np.isfinite(scan.ranges_m) != np.isfinite(expected)) <= 2
    assert both.sum() > 50
    assert np.median(np.abs(scan.ranges_m[both] - expected[both])) < 0.002
    assert np.abs(scan.ranges_m[both] - expected[both]).max() < 0.02


def test_the_scan_is_the_turtlebot_s() -> None:
    spec = LidarSpec()
    angles = beam_angles(spec)
    assert (angles[0], angles[-1], len(angles)) == (0.0, 6.28, 360)
    assert np.rad2deg(angles[1] - angles[0]) == pytest.approx(1.00228, abs=1e-5)
    assert len(beam_angles(LidarSpec(beams=1440))) == 1440


def test_noise_keeps_to_range_limits_and_drops_some() -> None:
    spec = LidarSpec(dropout=0.1)
    distances = np.concatenate([np.full(20_000, 5.0), np.full(100, 0.05), np.full(100, 15.2), np.full(100, np.inf)])
    ranges = noisy(distances, spec, draws(1, Stream.SCAN))
    assert np.isinf(ranges[20_000:]).all()
    assert np.isinf(ranges[:20_000]).mean() == pytest.approx(0.1, abs=0.01)


def test_beams_pass_through_the_robot_and_see_who_walks(stage_text: StageText) -> None:
    staged = stage_text(
        """\
objects = [ { class = "person", variant = "coat", at = [2.0, 3.0], walk = [[2.0, -3.0]], speed_mps = 1.0 } ]
[trajectory]
waypoints = [ { at = [0.0, 0.0], stop_s = 1.0 } ]
"""
    )
    spec = LidarSpec(sigma_m=0.0, dropout=0.0)
    seen = []
    for world, history in simulated(staged, 1000):
        for start_ns in (0, 3_000_000_000):
            ranges = cast(world, history, spec, np.full(spec.beams, start_ns)).distances_m
            seen.append(np.rad2deg(beam_angles(spec)[np.isfinite(ranges)]).mean())
            assert ranges.min() > 1.5
    assert seen[0] == pytest.approx(np.rad2deg(np.arctan2(3.0, 2.064)), abs=1.0)
    assert seen[1] == pytest.approx(180.0, abs=180.0)


def test_reflectors_shine_out_where_intensities_are_told(stage_text: StageText) -> None:
    staged = stage_text(SCENE.replace('"fire hydrant"', '"reflector"'))
    for world, history in simulated(staged, 100):
        for is_told in (True, False):
            spec = LidarSpec(sigma_m=0.0, dropout=0.0, intensities=is_told, instantaneous=True)
            scan = next(Lidar(spec, seed=0, start_ns=10**18).measure(history, world)).message
            assert isinstance(scan, LaserScan)
            if not is_told:
                assert len(scan.intensities) == 0
                continue
            ahead = np.abs(np.sin(beam_angles(spec) - np.arctan2(0.4, 3.064))) < 0.1
            on_post = ahead & np.isfinite(scan.ranges_m)
            on_box = ~ahead & np.isfinite(scan.ranges_m)
            assert scan.intensities[on_post].max() > 240
            assert 0 < scan.intensities[on_box].max() < 120
            assert not scan.intensities[~np.isfinite(scan.ranges_m)].any()


def test_rotation_by_quaternions_is_that_of_matrices() -> None:
    half = np.deg2rad(35.0)
    quaternion = np.array([[0.0, 0.0, np.sin(half), np.cos(half)]])
    turned = rotate(quaternion, np.array([[1.0, 0.0, 0.5]]))
    assert turned[0] == pytest.approx([np.cos(2 * half), np.sin(2 * half), 0.5])
