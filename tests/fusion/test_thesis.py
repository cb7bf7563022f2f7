"""The thesis's fusion: three boxes and three objects, each from left to right, or nothing."""

import numpy as np
from mcap_landmarks.fusion.thesis import fuse_in_order

from tests.fusion.cylinders import Thing, boxes, detected, scanned

FOUR = (
    Thing("person", 5.0, 2.0),
    Thing("suitcase", 5.0, 0.5),
    Thing("fire hydrant", 5.0, -0.5),
    Thing("cone", 5.0, -2.0),
)
CENTRE_PX = 320.5


def test_boxes_and_objects_pair_from_left_to_right() -> None:
    """Whatever their order, and wherever they are about the middle of the image."""
    for names in (FOUR[:3], FOUR[1:], (FOUR[1], FOUR[3], FOUR[0]), FOUR[2::-1]):
        objects = scanned(names, 5)
        for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0], [2, 1, 0]):
            given = detected([names[i].name for i in order], boxes([names[i] for i in order]), 5)
            scene, left_over = fuse_in_order(objects, given, CENTRE_PX)
            assert (scene.stamp_ns, scene.frame_id, left_over) == (5, "base_footprint", 0)
            by_id = dict(zip(scene.ids, scene.classes, strict=True))
            assert by_id == {str(i): thing.name for i, thing in enumerate(names)}
            places = dict(zip(scene.ids, scene.positions_xy.tolist(), strict=True))
            assert places == {str(i): objects.positions_xy[i][-1].tolist() for i in range(3)}
            assert not scene.covariances.any()
            assert not scene.radii_m.any()


def test_other_numbers_than_three_and_three_are_no_scene() -> None:
    for count, boxes_ in ((2, 2), (3, 2), (2, 3), (4, 4), (0, 3)):
        seen = FOUR[:boxes_]
        given = detected([thing.name for thing in seen], boxes(seen), 5)
        scene, left_over = fuse_in_order(scanned(FOUR[:count], 5), given, CENTRE_PX)
        assert (len(scene), left_over) == (0, boxes_)


def test_a_scan_without_an_image_is_no_scene() -> None:
    scene, left_over = fuse_in_order(scanned(FOUR[:3], 5), None, CENTRE_PX)
    assert (len(scene), scene.positions_xy.shape, left_over) == (0, (0, 2), 0)
    np.testing.assert_array_equal(scene.covariances, np.zeros((0, 2, 2)))
