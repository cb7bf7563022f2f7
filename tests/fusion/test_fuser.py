"""Fusion: classes to the right places, from images that err and scans that see more than the camera."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from mcap_landmarks.channels import DETECTIONS, SCAN_OBJECTS
from mcap_landmarks.fusion.camera_view import SeenImage
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.fuser import Fuser
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, OdometryAt

from tests.fusion.cylinders import (
    NAMES,
    SECOND,
    THREE,
    Thing,
    believe,
    boxes,
    bundle,
    camera_view,
    check,
    detected,
    fused,
    moved,
    plain,
    scanned,
)


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
    scenes, left_out = fused([bundle(scanned(THREE, SECOND), wrong)])
    assert scenes[0].classes == ("suitcase",)
    assert len(left_out) == 2


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


def test_a_merged_cluster_is_no_object() -> None:
    """Where the bare surface alone explains the hits, or a class has no hypothesis, there is no centre to trust."""
    objects, given = scanned(THREE, SECOND), detected(NAMES, boxes(THREE), SECOND)
    bare = tuple((name, 1e-6) for name, _ in objects.hypotheses[0][:-1])
    hypotheses = ((*bare, ("", 1.0)), (("", 1.0),), objects.hypotheses[2])
    positions = (objects.positions_xy[0], objects.positions_xy[1][-1:], objects.positions_xy[2])
    covariances = (objects.covariances[0], objects.covariances[1][-1:], objects.covariances[2])
    merged = dataclasses.replace(objects, hypotheses=hypotheses, positions_xy=positions, covariances=covariances)
    scenes, _ = fused([bundle(merged, given)] * 5)
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


def driven(seen: Sequence[Thing], named: Sequence[Thing], steps: int, ids: Sequence[str] | None = None) -> list[Bundle]:
    """Bundles along a way straight ahead: what the LiDAR sees, and what the camera does."""
    bundles = []
    for i in range(steps):
        odometry = np.array([0.3 * i, 0.0, 0.0])
        local = [[Thing(t.name, t.x - odometry[0], t.y) for t in things] for things in (seen, named)]
        given = detected([t.name for t in named], boxes(local[1]), SECOND)
        whole = bundle(scanned(local[0], SECOND, ids), given)
        at = OdometryAt("odom", odometry, np.zeros((3, 3)), 0.0, 0.0)
        bundles.append(dataclasses.replace(whole, odometry=at))
    return bundles


def test_a_box_of_what_the_lidar_does_not_see_is_of_nothing_else() -> None:
    """Not of the only thing that is nearly in line with it."""
    hidden, beside = Thing("fire hydrant", 9.0, 1.5), Thing("cone", 7.0, 0.99)
    scenes, left_out = fused(driven((beside, THREE[2]), (hidden, THREE[2]), 4))
    assert [scene.classes for scene in scenes] == [("suitcase",)] * 4
    assert left_out == ["detections where the scan has no object that fits"] * 4


def test_another_part_of_an_object_is_that_object() -> None:
    """A scan may show another leg of a chair than the one that the boxes fell on, and name it anew."""
    bundles = driven(THREE, THREE, 4)
    objects = scanned([Thing(t.name, t.x - 0.9, t.y) for t in THREE], 2 * SECOND, ["new", "1", "2"])
    scenes, _ = fused([*bundles, dataclasses.replace(bundles[-1], messages={SCAN_OBJECTS: objects})])
    assert scenes[-1].ids == ("new", "1", "2")
    assert scenes[-1].classes == tuple(NAMES)


def test_boxes_that_another_object_explains_are_its_own() -> None:
    """Seen in line, the nearer one got the box; later the farther one has it, and the nearer one had only that."""
    hydrant, cone = Thing("fire hydrant", 9.0, 0.6), Thing("cone", 7.0, 0.46)
    ahead = driven((cone, THREE[2]), (hydrant, THREE[2]), 4)
    beside = driven((cone, THREE[2], hydrant), (hydrant, THREE[2]), 16)[4:]
    scenes, _ = fused(ahead + beside)
    last = scenes[-1]
    places = [xy for xy, name in zip(last.positions_xy.tolist(), last.classes, strict=True) if name == "fire hydrant"]
    assert len(places) == 1
    np.testing.assert_allclose(places[0], [hydrant.x - 4.5, hydrant.y], atol=0.05)


def step(
    fuser: Fuser, seen: Sequence[Thing], named: Sequence[Thing] | None, odometry: Array | None, score: float = 0.3
) -> tuple[SceneObjects, int]:
    """A scan, and boxes of an image at the same time, if there is one."""
    if named is None:
        return fuser.add(scanned(seen, SECOND), [], odometry)
    given = detected([thing.name for thing in named], boxes(named), SECOND, score)
    return fuser.add(scanned(seen, SECOND), [SeenImage(given, camera_view())], odometry)


def probabilities(scene: SceneObjects) -> list[float]:
    return [options[0][1] for options in scene.hypotheses]


def test_evidence_adds_up_along_a_way() -> None:
    """Of a poor detector's boxes, from places 0.4 m apart; none is surer than a thousand to one."""
    fuser, found = Fuser(FuseConfig()), []
    for i in range(3):
        things = moved(THREE, (1.0, 0.0, 0.0), 0.4 * i)
        found.append(probabilities(step(fuser, things, things, np.array([0.4 * i, 0.0, 0.0]))[0]))
    expected = [[0.740964, 0.798649, 0.578925], [0.996091, 0.994408, 0.982747], [1000 / 1001] * 3]
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_images_from_one_place_say_the_same_again() -> None:
    fuser = Fuser(FuseConfig())
    found = [probabilities(step(fuser, THREE, THREE, np.zeros(3))[0]) for _ in range(3)]
    expected = [[0.740964, 0.798649, 0.578925], [0.850002, 0.891923, 0.709323], [0.918208, 0.944966, 0.812424]]
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_turning_on_the_spot_shows_nothing_new() -> None:
    """What is to the left after a turn to the right is where it was."""
    turned, stood = Fuser(FuseConfig()), Fuser(FuseConfig())
    for i in range(3):
        things = moved(THREE, (0.0, 0.0, -0.1), float(i))
        scene, _ = step(turned, things, things, np.array([0.0, 0.0, -0.1 * i]))
        expected, _ = step(stood, THREE, THREE, np.zeros(3))
    np.testing.assert_allclose(probabilities(scene), probabilities(expected), atol=0.06)


def test_without_odometry_every_scan_is_judged_on_its_own() -> None:
    """By higher odds at first, since no second look could mend what is left out."""
    scene, _ = step(Fuser(FuseConfig()), THREE, THREE, None)
    np.testing.assert_allclose(probabilities(scene), [0.966221, 0.975409, 0.932198], atol=1e-5)


def test_a_miss_counts_where_the_image_would_show_the_object_only() -> None:
    """The person is gone from the image, and so are the others; a thing behind the robot is not looked for."""
    fuser = Fuser(FuseConfig())
    behind = Thing("chair", -4.0, 0.0)
    for i in range(3):
        things = moved([*THREE, behind], (1.0, 0.0, 0.0), 0.4 * i)
        step(fuser, things, things[:3], np.array([0.4 * i, 0.0, 0.0]), 0.8)
    believe(fuser._tracks, "3", "chair", 0.9)
    things = moved([*THREE, behind], (1.0, 0.0, 0.0), 1.6)
    scene, unexplained = step(fuser, things, things[::2][:2], np.array([1.6, 0.0, 0.0]), 0.8)
    assert unexplained == 0
    assert scene.ids == ("0", "1", "2", "3")
    shares = probabilities(scene)
    assert shares[0] == shares[2] == pytest.approx(1000 / 1001)
    assert shares[1] == pytest.approx(200 / 201, rel=1e-4)
    assert shares[3] == pytest.approx(0.9)


def test_boxes_are_kept_where_they_tell_something_new_and_the_place_is_known() -> None:
    """For telling later which of two tracks they were of."""
    fuser = Fuser(FuseConfig())
    for i in (0, 0, 1):
        things = moved(THREE, (1.0, 0.0, 0.0), 0.4 * i)
        step(fuser, things, things, np.array([0.4 * i, 0.0, 0.0]))
    assert [(box.bundle, box.name) for box in fuser._tracks["1"].history.boxes] == [(1, "person"), (3, "person")]
    assert [sorted(fuser._tracks[name].history.places) for name in ("0", "1", "2")] == [[1, 2, 3]] * 3
    lost = Fuser(FuseConfig())
    step(lost, THREE, THREE, None)
    assert lost._tracks["1"].history.boxes == []
    assert lost._tracks["1"].place_xy is None


def test_a_box_that_the_image_cuts_at_a_side_does_not_tell_a_radius() -> None:
    """One that it cuts above does."""
    whole, cut = Thing("vase", 4.0, 0.5), Thing("vase", 2.0, 1.1)
    fuser = Fuser(FuseConfig())
    step(fuser, (whole,), (whole,), np.zeros(3))
    radius_m = fuser._tracks["0"].belief.radii_m["vase"]
    assert radius_m == pytest.approx(0.2, abs=0.01)
    assert boxes([cut])[0, 0] == 0
    step(fuser, (cut,), (cut,), np.array([2.0, -0.6, 0.0]))
    assert fuser._tracks["0"].belief.hits == 2
    assert fuser._tracks["0"].belief.radii_m["vase"] == radius_m
    near = Thing("vase", 1.3, 0.0)
    assert boxes([near])[0, 1] == 0
    step(fuser, (near,), (near,), np.array([2.7, 0.5, 0.0]))
    assert fuser._tracks["0"].belief.radii_m["vase"] != radius_m


def test_two_tracks_compete_for_a_box_and_the_likelier_one_has_it() -> None:
    """The box is of the nearer one; the other one, half a metre beside it, is not named at all."""
    two = (Thing("person", 6.0, 0.0), Thing("person", 6.0, 0.5), THREE[2])
    scene, _ = step(Fuser(FuseConfig()), two, two[::2], np.zeros(3), 0.8)
    assert scene.ids == ("0", "2")
    between = (Thing("person", 6.0, 0.02), Thing("person", 6.0, -0.02), THREE[2])
    scene, _ = step(Fuser(FuseConfig()), between, (Thing("person", 6.0, 0.0), THREE[2]), np.zeros(3), 0.8)
    assert scene.ids[-1] == "2"
    assert len(scene) <= 2
    for track in probabilities(scene)[:-1]:
        assert track < 0.6  # it could be the other one as well


def test_a_scan_without_an_image_keeps_what_is_known() -> None:
    fuser = Fuser(FuseConfig())
    before, _ = step(fuser, THREE, THREE, np.zeros(3))
    after, unexplained = step(fuser, moved(THREE, (1.0, 0.0, 0.0), 0.4), None, np.array([0.4, 0.0, 0.0]))
    assert unexplained == 0
    assert after.hypotheses == before.hypotheses
    np.testing.assert_allclose(after.positions_xy, before.positions_xy - [0.4, 0.0])


@pytest.mark.parametrize(("with_image", "with_odometry"), [(True, True), (False, True), (True, False)])
def test_a_track_that_comes_back_is_told_of_as_of_the_last_image(with_image: bool, with_odometry: bool) -> None:
    """The nearer of two in line had the boxes at first; it is out of sight while the farther one gets its own."""
    hydrant, cone = Thing("fire hydrant", 9.0, 0.6), Thing("cone", 7.0, 0.46)
    fuser, last = Fuser(FuseConfig()), 18
    for i in range(last + 1):
        local = dict(zip(("near", "beside", "far"), moved([cone, THREE[2], hydrant], (0.3, 0.0, 0.0), i), strict=True))
        given = detected(["fire hydrant", "suitcase"], boxes([local["far"], local["beside"]]), SECOND)
        if i < 4:
            del local["far"]
        elif 6 <= i < last:
            del local["near"]
        images = [SeenImage(given, camera_view())] if with_image or i < last else []
        objects = scanned(list(local.values()), SECOND, list(local))
        odometry = np.array([0.3 * i, 0.0, 0.0]) if with_odometry or i < last else None
        scene, _ = fuser.add(objects, images, odometry)
    assert scene.ids == ("beside", "far")
    assert fuser._tracks["near"].belief.best()[0] == "fire hydrant"
