"""Markers of a scene: what RViz and Foxglove draw of its objects."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.fusion.scene_markers import markers_from_scene
from mcap_landmarks.maps.map_markers import class_color
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.markers import MarkerArray, MarkerShape
from mcap_landmarks.messages.scene import SceneObjects

SCENE = SceneObjects(
    7,
    "base_footprint",
    ("a", "b"),
    ((("person", 0.876), ("suitcase", 0.1)), (("sports ball", 0.994),)),
    np.array([[5.0, 1.0], [3.0, -1.0]]),
    np.zeros((2, 2, 2)),
    np.array([0.25, 0.01]),
)

YAWS = np.array([2.5, 0.0])


def test_an_object_is_a_cylinder_and_a_label_above_it() -> None:
    drawn = markers_from_scene(SCENE)
    assert (drawn.stamp_ns, drawn.frame_id, drawn.replaces) == (7, "base_footprint", True)
    body, label, *_ = drawn.markers
    assert (body.shape, label.shape) == (MarkerShape.CYLINDER, MarkerShape.TEXT_VIEW_FACING)
    np.testing.assert_allclose(body.position_m, [5.0, 1.0, 0.25])
    np.testing.assert_allclose(body.size_m, [0.5, 0.5, 0.5])
    np.testing.assert_allclose(label.position_m, [5.0, 1.0, 0.75])
    np.testing.assert_allclose(label.size_m, [0.0, 0.0, 0.25])
    assert label.text == "person 88 %"
    assert body.color == label.color == class_color("person")


def test_objects_are_numbered_and_never_too_small_to_see() -> None:
    drawn = markers_from_scene(SCENE).markers
    keys = [(marker.name, marker.number) for marker in drawn]
    assert keys == [("objects", 0), ("names", 0), ("objects", 1), ("names", 1)]
    assert drawn[2].size_m[0] == pytest.approx(0.1)
    assert drawn[3].text == "sports ball 99 %"


def test_an_object_of_a_cloud_is_a_cuboid_that_lies_and_is_as_high_as_it() -> None:
    boxes = Boxes(np.array([[5.0, 1.0, 0.8], [3.0, -1.0, 0.1]]), np.array([[4.2, 1.7, 1.5], [0.2, 0.2, 0.02]]), YAWS)
    drawn = markers_from_scene(replace(SCENE, boxes=boxes))
    body, label, small, _ = decode(MarkerArray, encode(drawn)).markers
    assert (body.shape, label.shape) == (MarkerShape.CUBE, MarkerShape.TEXT_VIEW_FACING)
    assert body.yaw_rad == pytest.approx(2.5)
    np.testing.assert_allclose(body.position_m, [5.0, 1.0, 0.8])
    np.testing.assert_allclose(body.size_m, [4.2, 1.7, 1.5])
    np.testing.assert_allclose(label.position_m, [5.0, 1.0, 0.8 + 0.75 + 0.6])
    assert body.color[:3] == pytest.approx(class_color("person")[:3])
    assert 0 < body.color[3] < 1  # the points on it show
    assert small.size_m.tolist() == [0.2, 0.2, 0.1]
