"""Fusion: classes to the right places, from images that err and scans that see more than the camera."""

import dataclasses
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import DETECTIONS, SCENE_MARKERS
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.markers import MarkerArray, MarkerShape
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.typestore import typestore
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages.fuse import process

from tests.fusion.cylinders import (
    KNOWN,
    THREE,
    Thing,
    boxes,
    bundle,
    detected,
    fused,
    information,
    moved,
    scanned,
)

SECOND = 10**9
NAMES = [thing.name for thing in THREE]


def plain(stamp_ns: int = SECOND, things: tuple[Thing, ...] = THREE) -> Bundle:
    return bundle(scanned(things, stamp_ns), detected([t.name for t in things], boxes(things), stamp_ns))


def check(scene: SceneObjects, things: tuple[Thing, ...]) -> None:
    assert scene.classes == tuple(thing.name for thing in things)
    np.testing.assert_allclose(scene.positions_xy, [[thing.x, thing.y] for thing in things], atol=1e-9)


def test_every_object_gets_its_class_and_its_centre() -> None:
    scenes, left_out = fused([plain()])
    check(scenes[0], THREE)
    assert not left_out
    assert (scenes[0].stamp_ns, scenes[0].frame_id) == (SECOND, "base_footprint")
    np.testing.assert_allclose(scenes[0].covariances, np.tile(1e-4 * np.eye(2), (3, 1, 1)))
    assert [options[0][1] > 0.5 for options in scenes[0].hypotheses] == [True] * 3
    np.testing.assert_allclose(scenes[0].radii_m, [0.15, 0.25, 0.29])


def test_counts_need_not_agree() -> None:
    things = (*THREE, Thing("wall", 3.0, 0.3), Thing("person", -4.0, 1.0))
    far = Thing("suitcase", 6.0, 2.0)
    given = detected([*NAMES, "suitcase"], boxes([*THREE, far]), SECOND)
    scenes, left_out = fused([bundle(scanned(things, SECOND), given)])
    check(scenes[0], THREE)
    assert left_out == ["detections where the scan has no object that fits"]


def test_what_is_hidden_or_out_of_view_keeps_its_class() -> None:
    velocity = (0.0, 0.0, 0.5)
    bundles = []
    for i in range(12):
        things = moved(THREE, velocity, i * 0.5)
        given = detected(NAMES, boxes(things), SECOND) if i != 1 else detected([], np.zeros((0, 4)), SECOND)
        bundles.append(bundle(scanned(things, SECOND), given, velocity))
    scenes, _ = fused(bundles[:1] * 3 + bundles)
    assert [scene.classes for scene in scenes] == [tuple(NAMES)] * 15


def test_a_box_that_hides_what_is_behind_it_says_nothing_against_that() -> None:
    things = (Thing("fire hydrant", 3.0, 0.5), Thing("person", 6.0, 1.0), Thing("suitcase", 4.0, -1.0))
    both = plain(SECOND, things)
    alone = detected(["fire hydrant", "suitcase"], boxes([things[0], things[2]]), SECOND)
    scenes, _ = fused([both] + [bundle(scanned(things, SECOND), alone)] * 30)
    assert scenes[-1].classes == ("fire hydrant", "person", "suitcase")


def test_what_images_no_longer_show_is_forgotten() -> None:
    empty = detected([], np.zeros((0, 4)), SECOND)
    scenes, _ = fused([plain()] * 5 + [bundle(scanned(THREE, SECOND), empty)] * 30)
    assert len(scenes[6]) == 3
    assert len(scenes[-1]) == 0


@pytest.mark.parametrize("at", [0, 3])
def test_a_wrong_class_in_one_image_does_not_stick(at: int) -> None:
    wrong = detected(["suitcase", "person", "suitcase"], boxes(THREE), SECOND)
    bundles = [plain() if i != at else bundle(scanned(THREE, SECOND), wrong) for i in range(6)]
    scenes, _ = fused(bundles)
    for scene in scenes[at + 2 :]:
        check(scene, THREE)
    if at:
        check(scenes[at], THREE)


def test_a_class_that_does_not_fit_the_box_is_not_believed() -> None:
    wrong = detected(["person", "fire hydrant", "suitcase"], boxes(THREE), SECOND)
    scenes, left_out = fused([bundle(scanned(THREE, SECOND), wrong)], FuseConfig(min_objects=1))
    assert scenes[0].classes == ("suitcase",)
    assert len(left_out) == 2


@pytest.mark.parametrize("late_s", [-0.1, 0.1])
def test_an_image_is_brought_to_the_scans_time(late_s: float) -> None:
    velocity = (0.3, 0.0, 1.5)
    seen = boxes(moved(THREE, velocity, late_s))
    given = detected(NAMES, seen, SECOND + round(late_s * SECOND))
    things = scanned(THREE, SECOND)
    check(fused([bundle(things, given, velocity)])[0][0], THREE)
    assert len(fused([bundle(things, given)])[0][0]) == 0


def test_height_tells_what_stands_behind_from_what_stands_before() -> None:
    near, far = Thing("cone", 3.0, 0.0), Thing("person", 6.0, 0.1)
    things = (near, far, Thing("suitcase", 4.0, -1.2))
    given = detected(["person", "suitcase"], boxes(things[1:]), SECOND)
    check(fused([bundle(scanned(things, SECOND), given)])[0][0], things[1:])


def test_what_hangs_above_is_nothing_that_the_lidar_meets() -> None:
    seen = boxes(THREE)
    lamps = seen.copy()
    lamps[:, [1, 3]] = 10.0, 60.0
    given = detected(["boat", "car", "boat", *NAMES], np.concatenate([lamps, seen]), SECOND)
    scenes, left_out = fused([bundle(scanned(THREE, SECOND), given)] * 3)
    check(scenes[-1], THREE)
    assert len(left_out) == 9


def test_an_unknown_class_gets_its_radius_from_its_boxes() -> None:
    vase = Thing("vase", 4.0, 0.5)
    things = (vase, THREE[2])
    given = detected(["vase", "suitcase"], boxes(things), SECOND)
    scenes, _ = fused([bundle(scanned(things, SECOND), given)])
    assert scenes[0].classes == ("vase", "suitcase")
    np.testing.assert_allclose(scenes[0].positions_xy[0], [4.0, 0.5], atol=0.01)
    assert scenes[0].radii_m[0] == pytest.approx(0.2, abs=0.01)
    along = np.array([4.0, 0.5]) / np.hypot(4.0, 0.5)
    assert along @ scenes[0].covariances[0] @ along == pytest.approx(1e-4 + 0.06**2, rel=0.1)


def test_an_object_cut_by_the_images_edge_is_still_found() -> None:
    angle = np.deg2rad(30.0)
    cut = Thing("person", 2.5 * np.cos(angle), 2.5 * np.sin(angle))
    seen = boxes([cut, THREE[2]])
    assert seen[0, 0] == 0
    assert seen[0, 2] < 70
    given = detected(["person", "suitcase"], seen, SECOND)
    check(fused([bundle(scanned((cut, THREE[2]), SECOND), given)])[0][0], (cut, THREE[2]))


def test_classes_are_chosen_and_ignored() -> None:
    scenes, left_out = fused([plain()], FuseConfig(landmark_classes=("person", "suitcase")))
    assert scenes[0].classes == ("person", "suitcase")
    assert left_out == ["detections of fire hydrant, which is no landmark by the settings"]
    scenes, _ = fused([plain()], FuseConfig(ignore_classes=("person",)))
    assert scenes[0].classes == ("fire hydrant", "suitcase")


def test_one_object_is_no_scene() -> None:
    scenes, _ = fused([plain(SECOND, THREE[:1]), plain(SECOND, ())])
    assert [len(scene) for scene in scenes] == [0, 0]
    assert len(fused([plain(SECOND, THREE[:1])], FuseConfig(min_objects=1))[0][0]) == 1


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


def test_a_merged_cluster_is_no_object() -> None:
    """Where the bare surface alone explains the hits, or a class has no hypothesis, there is no centre to trust."""
    objects, given = scanned(THREE, SECOND), detected(NAMES, boxes(THREE), SECOND)
    bare = tuple((name, 1e-6) for name, _ in objects.hypotheses[0][:-1])
    hypotheses = ((*bare, ("", 1.0)), (("", 1.0),), objects.hypotheses[2])
    positions = (objects.positions_xy[0], objects.positions_xy[1][-1:], objects.positions_xy[2])
    covariances = (objects.covariances[0], objects.covariances[1][-1:], objects.covariances[2])
    merged = dataclasses.replace(objects, hypotheses=hypotheses, positions_xy=positions, covariances=covariances)
    scenes, _ = fused([bundle(merged, given)] * 5, FuseConfig(min_objects=1))
    assert [scene.classes for scene in scenes] == [("suitcase",)] * 5


def test_what_stands_beside_a_box_again_and_again_is_not_in_it() -> None:
    beside = Thing("cone", 5.0, 1.16)
    things = (beside, *THREE[1:])
    given = detected(NAMES, boxes(THREE), SECOND)
    scenes, _ = fused([bundle(scanned(things, SECOND), given)] * 20)
    assert scenes[-1].classes == tuple(NAMES[1:])


def test_two_tracks_of_one_object_are_one() -> None:
    half = Thing("person", 6.05, -0.15)
    first = bundle(scanned((*THREE, half), SECOND), detected(NAMES, boxes(THREE), SECOND))
    second = bundle(scanned((*THREE[:1], half, THREE[2]), SECOND, ["0", "3", "2"]), first.messages[DETECTIONS])
    scenes, _ = fused([first, second, first])
    assert sorted(scenes[-1].classes) == sorted(NAMES)


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
