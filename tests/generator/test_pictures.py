"""The README's pictures show what they say."""

import numpy as np
import pytest
from mcap_landmarks_generator.pictures import birds_eye, first_good_image, lidar_field, top_view

from tests.generator.conftest import StageText

SCENE = """\
objects = [
  { class = "fire hydrant", at = [3.0, 0.5], look = 1 },
  { class = "person", at = [4.0, -0.8], look = 2 },
  { class = "suitcase", at = [4.5, 1.6], look = 2 },
]
[trajectory]
waypoints = [ { at = [0.0, 0.0] }, { at = [1.0, 0.0], stop_s = 0.5 } ]
"""


def pixels_like(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.argwhere(np.abs(image.astype(int) - colour).max(axis=2) < 30)


def test_the_way_lies_where_it_is_driven(stage_text: StageText) -> None:
    image = top_view(stage_text(SCENE), width_px=200, side_m=10.0)
    rows, columns = pixels_like(image, (255, 200, 0)).T
    assert abs(rows.mean() - 100) < 2
    assert abs(columns.min() - 100) < 8
    assert abs(columns.max() - 120) < 8


def test_beams_end_on_the_objects(stage_text: StageText) -> None:
    image = lidar_field(stage_text(SCENE), width_px=300, side_m=12.0)
    beams = pixels_like(image, (255, 60, 40))
    assert len(beams) > 50
    # The middle of the picture is 3 m ahead of the robot; the hydrant stands 0.5 m to the left of there.
    near_hydrant = beams[np.abs(beams[:, 0] - (150 - 0.5 * 25)) < 4]
    assert abs(near_hydrant[:, 1].max() - (150 - 0.15 * 25)) < 6


@pytest.mark.slow
def test_views_from_a_height_and_from_the_robot_are_pictures(stage_text: StageText) -> None:
    staged = stage_text(SCENE)
    assert birds_eye(staged, (160, 80)).shape == (80, 160, 3)
    assert first_good_image(staged).shape == (480, 640, 3)
