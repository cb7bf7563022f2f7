"""The LiDAR of several rings: where its points lie, what edges and rain do, and that readers understand its clouds."""

from collections.abc import Iterator

import numpy as np
import pytest
from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks_generator.ring_cloud import RingCloud
from mcap_landmarks_generator.ring_lidar import POINTS, directions
from mcap_landmarks_generator.sensor_specs import RingLidarSpec
from mcap_landmarks_generator.simulation import Simulation

from tests.generator.conftest import StageText

SCENE = """\
objects = [
  { class = "person", at = [4.0, 0.0] },
  { class = "stop sign", variant = "post", at = [0.0, 6.0], yaw_deg = -90 },
]
camera = { when = "never" }
robot = { start = [0, 0, 0] }
trajectory = { waypoints = [{ at = [0, 0], stop_s = 0.4 }] }
[ring_lidar]
rate_hz = 5
sigma_m = 0.0
dropout = 0.0
divergence_mrad = 0.0
"""


def clouds(stage_text: StageText, more: str = "") -> Iterator[RingCloud]:
    for event in Simulation(stage_text(SCENE + more)).run():
        if event.channel is POINTS:
            assert isinstance(event.message, RingCloud)
            yield event.message


@pytest.fixture
def cloud(stage_text: StageText) -> RingCloud:
    return next(clouds(stage_text))


def test_points_lie_on_the_ground_and_on_objects(cloud: RingCloud) -> None:
    x, y, z = cloud.points_m.T
    on_ground = np.abs(z + 0.5) < 0.01  # the mast is half a metre high
    ahead = (np.abs(np.arctan2(y, x)) < 0.1) & ~on_ground
    assert 0.7 < on_ground.mean() < 1
    assert ahead.sum() > 30
    assert np.hypot(x[ahead], y[ahead]) == pytest.approx(4.0, abs=0.4)
    assert z[ahead].max() > 0.3  # rings above the LiDAR see the person's chest
    elevations = np.rad2deg(np.arcsin(z / np.linalg.norm(cloud.points_m, axis=1)))
    assert elevations == pytest.approx(-15 + 2 * cloud.rings, abs=1e-3)


def test_material_and_angle_make_the_intensity(cloud: RingCloud) -> None:
    x, y, z = cloud.points_m.T
    ground = (np.abs(z + 0.5) < 0.01) & (cloud.rings == 0)
    assert cloud.intensities[ground] == pytest.approx(255 * 0.25 * np.sin(np.deg2rad(15)), rel=0.02)
    sign = (np.abs(x) < 0.5) & (np.abs(y - 6) < 0.3) & (z > 0.5)
    assert cloud.intensities[sign].max() > 240


def test_beams_turn_left_within_a_turn(cloud: RingCloud) -> None:
    azimuth = np.arctan2(cloud.points_m[:, 1], cloud.points_m[:, 0]) % (2 * np.pi)
    assert azimuth == pytest.approx(2 * np.pi * cloud.times_ns / 200e6, abs=1e-4)
    assert directions(RingLidarSpec(rings=1, lowest_deg=0, highest_deg=0, beams=8))[2, 0] == pytest.approx([0, 1, 0])


def test_edges_and_rain_make_points_where_nothing_is(stage_text: StageText) -> None:
    def floating(more: str) -> int:
        points = next(clouds(stage_text, more)).points_m
        return int(((np.abs(points[:, 2] + 0.5) > 0.05) & (np.hypot(*points[:, :2].T) < 3.2)).sum())

    assert floating("") == 0
    assert floating("rain = 0.1\n") > 300


def test_mixed_pixels_lie_between_both_sides_of_an_edge(stage_text: StageText) -> None:
    wide = SCENE.replace("divergence_mrad = 0.0", "divergence_mrad = 7.0")
    (event, *_) = [event for event in Simulation(stage_text(wide)).run() if event.channel is POINTS]
    sharp = next(clouds(stage_text))
    assert isinstance(event.message, RingCloud)

    def depths(cloud: RingCloud) -> np.ndarray:
        ahead = (np.abs(np.arctan2(cloud.points_m[:, 1], cloud.points_m[:, 0])) < 0.15) & (cloud.rings == 6)
        return np.hypot(*cloud.points_m[ahead, :2].T)

    def between(cloud: RingCloud) -> int:
        return int(((depths(cloud) > 4.4) & (depths(cloud) < 9.0)).sum())

    assert between(sharp) == 0
    assert between(event.message) > 0


def test_readers_understand_the_cloud(cloud: RingCloud) -> None:
    read = decode(PointCloud2, encode(cloud))
    np.testing.assert_array_equal(read.points_m, cloud.points_m)
    np.testing.assert_array_equal(read.times_ns, cloud.times_ns)
    again = decode(RingCloud, encode(cloud))
    np.testing.assert_array_equal(again.intensities, cloud.intensities)
    np.testing.assert_array_equal(again.rings, cloud.rings)


def test_its_frame_is_told(stage_text: StageText) -> None:
    (frames,) = [event.message for event in Simulation(stage_text(SCENE)).run() if event.channel is TF_STATIC]
    (mast,) = [transform for transform in frames.transforms if transform.child_frame_id == "ring_lidar"]
    assert mast.frame_id == "base_footprint"
    assert mast.translation_m == pytest.approx([0, 0, 0.5])
