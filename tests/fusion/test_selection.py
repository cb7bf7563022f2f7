"""What is fused at all: objects that are somewhere, boxes with a class and a size, classes that the settings want."""

import dataclasses

import numpy as np
import pytest
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.selection import NO_BOX, UNWANTED, at_least, usable, wanted
from mcap_landmarks.messages.scene import SceneObjects

from tests.fusion.cylinders import THREE, boxes, detected, scanned

NAMES = [thing.name for thing in THREE]
GIVEN = detected(NAMES, boxes(THREE), 5)


def test_scan_objects_that_are_somewhere_are_used_whole() -> None:
    objects = scanned(THREE, 5)
    objects.positions_xy[1][0, 1] = np.nan
    kept = usable(objects)
    assert (kept.stamp_ns, kept.frame_id, kept.ids) == (5, "base_footprint", ("0", "2"))
    assert kept.hypotheses == (objects.hypotheses[0], objects.hypotheses[2])
    assert [one is objects.positions_xy[i] for one, i in zip(kept.positions_xy, (0, 2), strict=True)] == [True, True]
    assert [one is objects.covariances[i] for one, i in zip(kept.covariances, (0, 2), strict=True)] == [True, True]
    assert kept.extents_m.tolist() == [0.15, 0.25]


def test_scan_objects_of_unknown_spread_or_without_places_are_not_used() -> None:
    objects = scanned(THREE, 5)
    objects.covariances[0][0, 0, 0] = np.inf
    empty = np.zeros((0, 2))
    objects = dataclasses.replace(objects, positions_xy=(*objects.positions_xy[:2], empty))
    assert usable(objects).ids == ("1",)


@pytest.mark.parametrize(
    "box", [[30.0, 20.0, 10.0, 40.0], [10.0, 40.0, 30.0, 20.0], [10.0, 20.0, 10.0, 40.0], [10.0, np.nan, 30.0, 40.0]]
)
def test_a_box_must_be_one(box: list[float]) -> None:
    odd = dataclasses.replace(GIVEN, boxes_xyxy=np.array([GIVEN.boxes_xyxy[0], box, GIVEN.boxes_xyxy[2]]))
    kept, left_out = wanted(odd, FuseConfig())
    assert [options[0][0] for options in kept.hypotheses] == ["fire hydrant", "suitcase"]
    np.testing.assert_array_equal(kept.boxes_xyxy, GIVEN.boxes_xyxy[[0, 2]])
    assert left_out == {NO_BOX: 1}


def test_a_box_must_have_a_class() -> None:
    odd = dataclasses.replace(GIVEN, hypotheses=((), (("", 0.9),), GIVEN.hypotheses[2]))
    kept, left_out = wanted(odd, FuseConfig())
    assert kept.hypotheses == GIVEN.hypotheses[2:]
    assert left_out == {NO_BOX: 2}


def test_only_classes_that_are_wanted_count() -> None:
    def chosen(**settings: tuple[str, ...]) -> tuple[list[str], dict[str, int]]:
        kept, left_out = wanted(GIVEN, dataclasses.replace(FuseConfig(), **settings))
        return [options[0][0] for options in kept.hypotheses], dict(left_out)

    assert chosen() == (NAMES, {})
    hydrant, person = (UNWANTED.format(name) for name in ("fire hydrant", "person"))
    assert chosen(landmark_classes=("person", "suitcase")) == (["person", "suitcase"], {hydrant: 1})
    assert chosen(ignore_classes=("person",)) == (["fire hydrant", "suitcase"], {person: 1})
    both = chosen(landmark_classes=("person", "suitcase"), ignore_classes=("person",))
    assert both == (["suitcase"], {hydrant: 1, person: 1})


def test_no_detections_are_none() -> None:
    kept, left_out = wanted(detected([], np.zeros((0, 4)), 5), FuseConfig())
    assert (len(kept), kept.boxes_xyxy.shape, left_out) == (0, (0, 4), {})


def test_a_scene_of_too_few_is_empty_and_what_it_had_is_counted() -> None:
    classes = ((("car", 0.9),), (("person", 0.8),))
    scene = SceneObjects(5, "base", ("a", "b"), classes, np.zeros((2, 2)), np.zeros((2, 2, 2)), np.ones(2))
    assert at_least(scene, 2) == (scene, {})
    none, left_out = at_least(scene, 3)
    assert (none.stamp_ns, none.frame_id, none.ids, none.hypotheses) == (5, "base", (), ())
    assert (none.positions_xy.shape, none.covariances.shape, none.radii_m.shape) == ((0, 2), (0, 2, 2), (0,))
    assert left_out == {"objects of scenes with fewer than 3: car": 1, "objects of scenes with fewer than 3: person": 1}
