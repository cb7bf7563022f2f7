"""The stage fuse: what it takes of a bundle, leaves out and counts, and says where something is missing."""

import dataclasses
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import SCENE_MARKERS
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.markers import MarkerArray, MarkerShape
from mcap_landmarks.messages.typestore import typestore
from mcap_landmarks.stage import Stamped
from mcap_landmarks.stages.fuse import process

from tests.fusion.cylinders import (
    KNOWN,
    NAMES,
    SECOND,
    THREE,
    Thing,
    boxes,
    bundle,
    check,
    detected,
    fused,
    information,
    moved,
    plain,
    scanned,
)


@pytest.mark.parametrize("late_s", [-0.1, 0.1])
def test_an_image_is_brought_to_the_scans_time(late_s: float) -> None:
    velocity = (0.3, 0.0, 1.5)
    seen = boxes(moved(THREE, velocity, late_s))
    given = detected(NAMES, seen, SECOND + round(late_s * SECOND))
    things = scanned(THREE, SECOND)
    check(fused([bundle(things, given, velocity)])[0][0], THREE)
    assert len(fused([bundle(things, given)])[0][0]) == 0


def test_classes_are_chosen_and_ignored() -> None:
    scenes, left_out = fused([plain()], FuseConfig(landmark_classes=("person", "suitcase")))
    assert scenes[0].classes == ("person", "suitcase")
    assert left_out == ["detections of fire hydrant, which is no landmark by the settings"]
    scenes, _ = fused([plain()], FuseConfig(ignore_classes=("person",)))
    assert scenes[0].classes == ("fire hydrant", "suitcase")


def test_one_object_is_a_scene_unless_more_are_asked_for() -> None:
    scenes, left_out = fused([plain(SECOND, THREE[:1]), plain(SECOND, ())])
    assert ([len(scene) for scene in scenes], left_out) == ([1, 0], [])
    scenes, left_out = fused([plain(SECOND, THREE[:1])], FuseConfig(min_objects=2))
    assert (len(scenes[0]), left_out) == (0, ["objects of scenes with fewer than 2: fire hydrant"])


def test_what_is_nowhere_is_left_out() -> None:
    whole, objects = detected(NAMES, boxes(THREE), SECOND), scanned((*THREE, THREE[0]), SECOND)
    objects.positions_xy[3][:] = np.nan
    odd = np.concatenate([whole.boxes_xyxy, [[10.0, 20.0, 5.0, 30.0], [np.nan, 0.0, 9.0, 9.0]]])
    given = dataclasses.replace(
        whole, ids=("",) * 5, hypotheses=whole.hypotheses + ((("person", 0.9),),) * 2, boxes_xyxy=odd
    )
    scenes, left_out = fused([bundle(objects, given)])
    check(scenes[0], THREE)
    assert Counter(left_out) == {
        "detections without a class or a box": 2,
        "scan objects without a finite place": 1,
    }
    scenes, left_out = fused([bundle(scanned((), SECOND), whole)])
    assert len(scenes[0]) == 0
    assert len(left_out) == 3


def test_a_fisheye_sees_as_well() -> None:
    bent = (-0.04, 0.003, -0.002, 0.0004)
    info = information("equidistant", bent)
    model = CameraModel.of("equidistant", (640, 480), info.intrinsics, info.distortion)
    things = (Thing("person", 3.0, 1.5), Thing("fire hydrant", 4.0, -2.0))
    given = detected([t.name for t in things], boxes(things, model=model), SECOND)
    check(fused([bundle(scanned(things, SECOND), given, info=info)])[0][0], things)


def test_the_thesis_pairs_from_left_to_right_if_both_count_three() -> None:
    config = FuseConfig(method="thesis")
    order = [2, 0, 1]
    shuffled = detected([NAMES[i] for i in order], boxes([THREE[i] for i in order]), SECOND)
    scenes, left_out = fused([bundle(scanned(THREE, SECOND), shuffled)], config)
    assert scenes[0].classes == tuple(NAMES)
    surfaces = [np.array([t.x, t.y]) * (1 - KNOWN[t.name][0] / np.hypot(t.x, t.y)) for t in THREE]
    np.testing.assert_allclose(scenes[0].positions_xy, surfaces)
    np.testing.assert_array_equal(scenes[0].covariances, 0)
    assert not left_out
    two = detected(NAMES[:2], boxes(THREE[:2]), SECOND)
    scenes, left_out = fused([bundle(scanned(THREE, SECOND), two)], config)
    assert len(scenes[0]) == 0
    assert len(left_out) == 2


def test_markers_are_a_cylinder_and_a_label_each() -> None:
    results = list(process([plain(), plain(SECOND, ())], FuseConfig(), {}))
    drawn = [e.message for e in results if isinstance(e, Stamped) and e.channel == SCENE_MARKERS]
    assert all(isinstance(message, MarkerArray) for message in drawn)
    first = drawn[0]
    assert [marker.shape for marker in first.markers] == [MarkerShape.CYLINDER, MarkerShape.TEXT_VIEW_FACING] * 3
    assert [marker.text.rpartition(" ")[0].rpartition(" ")[0] for marker in first.markers[1::2]] == NAMES
    np.testing.assert_allclose(first.markers[0].position_m[:2], [5.0, 1.0])
    np.testing.assert_allclose(first.markers[0].size_m[:2], [0.3, 0.3])
    ros = typestore().deserialize_cdr(encode(drawn[1]), MarkerArray.ROS_TYPE)
    assert [(marker.action, marker.header.frame_id) for marker in ros.markers] == [(3, "base_footprint")]
    keys = [(marker.name, marker.number) for marker in first.markers]
    assert len(set(keys)) == len(keys)


def test_what_is_missing_is_said() -> None:
    objects, given = scanned(THREE, SECOND), detected(NAMES, boxes(THREE), SECOND)
    with pytest.raises(RecordingError, match=r"no sensor_msgs/msg/CameraInfo.*--remap"):
        fused([bundle(objects, given, info=None)])
    with pytest.raises(RecordingError, match=r"from camera to base_footprint.*--extrinsics FILE"):
        fused([bundle(objects, given, transforms=None)])
    with pytest.raises(RecordingError, match=r"no /landmarks/detections lie beside any of 2 scans; run .* detect"):
        fused([bundle(objects)] * 2)
    assert fused([]) == ([], [])


@pytest.mark.parametrize("kind", ["toml", "json"])
def test_extrinsics_come_from_a_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"mount.{kind}"
    texts = {
        "toml": '[[transforms]]\nparent = "base_footprint"\nchild = "mast"\nxyz = [0.1, 0.0, 0.2]\n'
        '[[transforms]]\nparent = "mast"\nchild = "camera"\nxyz = [0, 0, 0]\nrpy = [-1.5707963, 0.0, -1.5707963]\n',
        "json": '{"transforms": [{"parent": "base_footprint", "child": "camera", "xyz": [0.1, 0, 0.2],'
        ' "quaternion": [-0.5, 0.5, -0.5, 0.5]}]}',
    }
    path.write_text(texts[kind])
    objects, given = scanned(THREE, SECOND), detected(NAMES, boxes(THREE), SECOND)
    check(fused([bundle(objects, given, transforms=None)], resources={"extrinsics": path})[0][0], THREE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nothing = 1", "no list transforms"),
        ("[[transforms]]\nparent = 'a'\nchild = 'b'", "transform 1: give parent, child, xyz"),
        ("[[transforms]]\nparent = 'a'\nchild = 'b'\nxyz = [1, 2]", "xyz = .*give 3 numbers"),
        ("[[transforms]]\nparent = 'a'\nchild = 'b'\nxyz = [1, 2, 3]\nquaternion = [0, 0, 0, 0]", "quaternion is zero"),
        ("[[transforms]", "cannot be read"),
    ],
)
def test_a_file_of_extrinsics_that_is_none_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mount.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=said):
        fused([plain()], resources={"extrinsics": path})
