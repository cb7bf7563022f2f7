"""Glass: LiDARs look through it but for beams that meet it straight on, cameras see its frame only."""

import numpy as np
import pytest
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.lidar import cast
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.ring_lidar import intensities_of
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M
from mcap_landmarks_generator.sensor_specs import LidarSpec
from mcap_landmarks_generator.world import Returns, World

from tests.generator.conftest import StageText
from tests.generator.test_camera import view_from

SCENE = """\
objects = [
  { class = "glass", at = [2.0, 0.0] },
  { class = "car", at = [6.0, 0.0], yaw_deg = 90 },
]
robot = { start = [0, 0, 0] }
camera = { width_px = 320, height_px = 240 }
trajectory = { waypoints = [{ at = [0, 0], stop_s = 0.1 }] }
"""


def scanned(stage_text: StageText, **settings: float) -> Returns:
    staged = stage_text(SCENE)
    with World(staged.objects, staged.start) as world:
        history = History()
        history.append(world.robot.state(), True)
        return cast(world, history, LidarSpec(**settings), np.zeros(360, np.int64))


def test_beams_go_through_but_for_those_that_meet_it_straight_on(stage_text: StageText) -> None:
    returns = scanned(stage_text)
    depth = returns.distances_m * np.cos(np.arange(360) * 6.28 / 359) + SCAN_IN_BASE_M[0]
    assert depth[:5] == pytest.approx(1.995, abs=0.005)  # up to 5 degrees: the pane
    assert returns.passed[:5].tolist() == [0] * 5
    assert 4.5 < depth[6] < 6.0  # the car behind it
    assert returns.passed[6] == 2
    assert np.isinf(returns.distances_m[22:24]).all()  # beside the car, behind the pane
    assert 1.9 < depth[25:28].min() < 2.03  # the frame
    assert scanned(stage_text, glass_deg=0.0).passed[1:7].tolist() == [2] * 6
    solid = scanned(stage_text, glass_deg=90.0)
    ahead = solid.distances_m[:20] * np.cos(np.arange(20) * 6.28 / 359)
    assert ahead == pytest.approx(1.995 - SCAN_IN_BASE_M[0], abs=0.01)


def test_what_is_behind_glass_is_a_little_darker(stage_text: StageText) -> None:
    through = scanned(stage_text)
    alone = Returns(through.distances_m, through.cosines, through.names, through.name_of, np.zeros_like(through.passed))
    share = intensities_of(through)[6] / intensities_of(alone)[6]
    assert share == pytest.approx(0.96**4)
    assert intensities_of(through)[0] == pytest.approx(255, rel=0.01)


def test_cameras_see_the_frame_only(stage_text: StageText) -> None:
    staged = stage_text(SCENE)
    view = view_from(0.0, 0.0, 0.0)
    both = Renderer(staged.scenario, staged.objects)
    without = Renderer(staged.scenario, staged.objects[1:])
    seen, bare = both.draw(view).image, without.draw(view).image
    inside = np.abs(seen[60:100, 40:280].astype(int) - bare[60:100, 40:280])
    # Another window is drawn, and its rounding differs.
    assert inside.max() <= 1
    assert np.abs(seen.astype(int) - bare).max() > 30
