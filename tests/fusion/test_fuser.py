"""Fusion: classes to the right places, from images that err and scans that see more than the camera."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from mcap_landmarks.channels import DETECTIONS, SCAN_OBJECTS
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, OdometryAt

from tests.fusion.cylinders import THREE, Thing, boxes, bundle, detected, fused, moved, scanned

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
    scenes, left_out = fused(driven((beside, THREE[2]), (hidden, THREE[2]), 4), FuseConfig(min_objects=1))
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
