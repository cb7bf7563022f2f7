"""Single objects seen from all sides."""

import numpy as np
import pytest
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.audition import YAWS_DEG, objects_of, views


def test_every_variant_of_a_class_comes() -> None:
    assert objects_of(["suitcase"]) == [("suitcase", name) for name in catalog.VARIANTS["suitcase"]]
    assert {name for name, _ in objects_of([])} == set(catalog.COCO_ID)
    with pytest.raises(ToolkitError, match="the generator has no unicorn; it has person, bicycle"):
        objects_of(["unicorn"])


@pytest.mark.slow
def test_an_object_stands_straight_ahead_at_its_distance() -> None:
    found = list(views("suitcase", "", 10_000, distances_m=(3.0,)))
    assert [view.yaw_deg for view in found] == [*YAWS_DEG]
    widths = []
    for view in found:
        (box,) = view.truth.boxes_xyxy
        assert abs((box[0] + box[2]) / 2 - view.image.shape[1] / 2) < 12  # the camera is a centimetre aside
        ranges = view.scan.ranges_m
        ahead = np.flatnonzero(np.isfinite(ranges))
        angles = (view.scan.angle_min_rad + view.scan.angle_increment_rad * ahead + np.pi) % (2 * np.pi) - np.pi
        assert 4 <= len(ahead) <= 16
        assert np.abs(angles).max() < np.deg2rad(10)
        # A suitcase is half a metre wide, and the LiDAR sits 6 cm behind the middle of the robot.
        assert 2.7 < float(ranges[ahead].min()) < 3.1
        widths.append(box[2] - box[0])
    front, aside = widths[YAWS_DEG.index(0)], widths[YAWS_DEG.index(90)]
    assert max(front, aside) > 1.4 * min(front, aside)  # its two faces


@pytest.mark.slow
def test_the_same_seed_gives_the_same_views() -> None:
    first, second = (next(views("person", "", seed, distances_m=(4.0,))) for seed in (10_000, 10_000))
    other = next(views("person", "", 10_001, distances_m=(4.0,)))
    assert np.array_equal(first.image, second.image)
    assert np.array_equal(first.scan.ranges_m, second.scan.ranges_m)
    assert not np.array_equal(first.image, other.image)
