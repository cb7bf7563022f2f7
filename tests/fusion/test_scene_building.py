"""The scene: which tracks are told, with what, and that one object is told once."""

import dataclasses

import numpy as np
import pytest
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.scene_building import scene_of
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.messages.scan_objects import ScanObjects

from tests.fusion.cylinders import THREE, Thing, believe, scanned, tracked


def known(
    *things: Thing, shares: tuple[float, ...] = (), config: FuseConfig | None = None
) -> tuple[ScanObjects, TrackTable]:
    """Objects whose tracks believe that they are what they are."""
    objects = scanned(things, 7)
    table = tracked(objects, config)
    for i, thing in enumerate(things):
        believe(table, str(i), thing.name, shares[i] if shares else 0.9)
    return objects, table


def test_a_scene_has_what_is_known_in_the_order_of_the_scan() -> None:
    scene = scene_of(*known(*THREE, shares=(0.8, 0.7, 0.9)))
    assert (scene.stamp_ns, scene.frame_id, scene.ids) == (7, "base_footprint", ("0", "1", "2"))
    assert scene.classes == ("fire hydrant", "person", "suitcase")
    np.testing.assert_allclose(scene.positions_xy, [[thing.x, thing.y] for thing in THREE])
    np.testing.assert_allclose(scene.covariances, np.tile(1e-4 * np.eye(2), (3, 1, 1)))
    np.testing.assert_allclose(scene.radii_m, [0.15, 0.25, 0.29])
    assert [options[0][1] for options in scene.hypotheses] == pytest.approx([0.8, 0.7, 0.9])


@pytest.mark.parametrize(("share", "told"), [(0.61, 1), (0.59, 0)])
def test_a_class_must_be_as_probable_as_the_settings_say(share: float, told: int) -> None:
    assert len(scene_of(*known(THREE[1], shares=(share,), config=FuseConfig(min_probability=0.6)))) == told


def test_what_no_box_has_named_is_not_told_even_if_nothing_need_be_sure() -> None:
    objects = dataclasses.replace(scanned(THREE[:2], 7), hypotheses=((("person", 1.0),),) * 2)
    table = tracked(objects, FuseConfig(min_probability=0.0))
    believe(table, "1", "person")
    assert scene_of(objects, table).ids == ("1",)


def test_a_redundant_track_is_not_told() -> None:
    objects, table = known(*THREE)
    table["1"].is_redundant = True
    assert scene_of(objects, table).ids == ("0", "2")


def test_what_the_scan_does_not_resolve_is_not_told() -> None:
    """A cluster that fits no shape of its class: hits of several things that have run together."""
    objects, table = known(*THREE)
    merged = (("fire hydrant", 1e-4), ("person", 1e-4), ("suitcase", 1e-4), ("", 1.0))
    objects = dataclasses.replace(objects, hypotheses=(objects.hypotheses[0], merged, objects.hypotheses[2]))
    assert scene_of(objects, table).ids == ("0", "2")


def test_a_class_that_scans_know_no_shape_of_is_told_all_the_same() -> None:
    objects, table = known(Thing("vase", 4.0, 0.0))
    table["0"].belief.radii_m = {"vase": 0.2}
    scene = scene_of(objects, table)
    np.testing.assert_allclose(scene.positions_xy, [[4.0, 0.0]])
    np.testing.assert_allclose(scene.radii_m, [0.2])


def test_hardly_probable_classes_are_not_told() -> None:
    objects, table = known(THREE[1])
    table["0"].belief.log_odds = {"person": np.log(90.0), "suitcase": np.log(0.5), "fire hydrant": np.log(0.4)}
    whole = 1 + 90.9
    assert 0.4 / whole < 0.005 < 0.5 / whole
    assert [name for name, _ in scene_of(objects, table).hypotheses[0]] == ["person", "suitcase"]
    assert scene_of(objects, table).hypotheses[0][1][1] == pytest.approx(0.5 / whole)


@pytest.mark.parametrize(("apart_m", "count"), [(0.32, 2), (0.30, 1)])
def test_of_two_of_a_class_in_one_place_the_surest_is_told(apart_m: float, count: int) -> None:
    """A person's radius is 0.25 m, and 1.25 of it too near for another one."""
    things = (Thing("person", 4.0, 0.0), Thing("person", 4.0, apart_m))
    scene = scene_of(*known(*things, shares=(0.8, 0.9)))
    assert scene.ids == ("0", "1")[2 - count :]
    scene = scene_of(*known(*things, shares=(0.9, 0.8)))
    assert scene.ids == ("0", "1")[:count]
    assert scene_of(*known(*things)).ids == ("0", "1")[:count]  # as sure as each other: the first


def test_places_are_compared_with_all_that_are_told() -> None:
    """Of three in a row the middle one, which is the least sure, goes."""
    row = tuple(Thing("person", 4.0, 0.2 * i) for i in range(3))
    assert scene_of(*known(*row, shares=(0.9, 0.7, 0.8))).ids == ("0", "2")
    assert scene_of(*known(*row, shares=(0.7, 0.9, 0.8))).ids == ("1",)


def test_things_of_two_classes_may_be_in_one_place() -> None:
    things = (Thing("person", 4.0, 0.0), Thing("suitcase", 4.0, 0.1))
    assert scene_of(*known(*things)).ids == ("0", "1")


def test_an_empty_scene_has_arrays_all_the_same() -> None:
    scene = scene_of(*known())
    assert (len(scene), scene.positions_xy.shape, scene.covariances.shape) == (0, (0, 2), (0, 2, 2))
