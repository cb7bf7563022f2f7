"""Fusion along a way: what boxes say again and again, from other places, about the same things."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from mcap_landmarks.channels import SCAN_OBJECTS
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.stage import Bundle, OdometryAt

from tests.fusion.cylinders import THREE, Thing, boxes, bundle, detected, fused, scanned

SECOND = 10**9
NAMES = [thing.name for thing in THREE]


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
