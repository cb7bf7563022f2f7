"""A landmark map is valid by construction."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.maps.map_message import map_from_scene, scene_from_map
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.scene import SceneObjects

from tests.maps.examples import assert_same_map, small_map

SKEW = np.array([[1.0, 0.5], [0.4, 1.0]])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"ids": ("a", "a", "c", "d")}, "not unique"),
        ({"classes": ("person", "", "person", "person")}, "no class"),
        ({"frame": ""}, "frame has no name"),
        ({"positions_xy": np.zeros((3, 2))}, "shape (3, 2) instead of (4, 2)"),
        ({"positions_xy": np.full((4, 2), np.nan)}, "not all numbers are finite"),
        ({"covariances": np.stack([SKEW] * 4)}, "landmark a: covariance"),
        ({"covariances": -np.stack([np.eye(2)] * 4)}, "landmark a: covariance"),
        ({"radii_m": np.array([1, 1, -1, 1])}, "landmark c: radius"),
        ({"sightings": np.array([1, 1, 1, -1])}, "landmark d: radius and sightings"),
        ({"groups": (Group(("a", "z"), np.zeros(3)),)}, "there is no landmark z"),
    ],
)
def test_nonsense_is_refused(change: dict[str, Any], complaint: str) -> None:
    with pytest.raises(MapError) as caught:
        replace(small_map(), **change)
    assert complaint in str(caught.value)


def test_groups_and_sources_are_checked() -> None:
    with pytest.raises(MapError, match="each of them once"):
        Group(("a", "a"), np.zeros(3))
    with pytest.raises(MapError, match="group a: pose: shape"):
        Group(("a",), np.zeros(2))
    with pytest.raises(MapError, match="group a: covariance"):
        Group(("a",), np.zeros(3), np.zeros((3, 3)))
    with pytest.raises(MapError, match="used 3 of 2"):
        MapSource("recording", "f", 2, 3)
    with pytest.raises(MapError, match="needs a kind"):
        MapSource("import", "")


def test_arrays_are_copied_read_only_and_symmetric() -> None:
    covariances = np.stack([np.array([[1.0, 1e-17], [0.0, 1.0]])] * 4)
    landmark_map = replace(small_map(), covariances=covariances)
    covariances[:] = 7
    assert landmark_map.covariances[0, 0, 1] == landmark_map.covariances[0, 1, 0] == 5e-18
    with pytest.raises(ValueError, match="read-only"):
        landmark_map.positions_xy[0, 0] = 1


def test_a_map_may_be_empty() -> None:
    empty = LandmarkMap((), (), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    assert len(empty) == 0
    assert empty.positions_xy.shape == (0, 2)
    assert empty.covariances.shape == (0, 2, 2)


def test_a_scene_carries_the_confirmed_landmarks() -> None:
    scene = decode(SceneObjects, encode(scene_from_map(small_map(), 17)))
    source = MapSource("reference", "cafe")
    found = map_from_scene(scene, source)
    assert scene.stamp_ns == 17
    kept = small_map()
    expected = LandmarkMap(
        kept.ids[:3],
        kept.classes[:3],
        kept.positions_xy[:3],
        kept.covariances[:3],
        kept.radii_m[:3],
        np.zeros(3, int),
        np.zeros(3, bool),
        sources=(source,),
    )
    assert_same_map(found, expected)


def test_an_empty_scene_is_no_map() -> None:
    nothing = SceneObjects(0, "map", (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))
    with pytest.raises(MapError, match="a map needs landmarks"):
        map_from_scene(nothing, MapSource("reference", "cafe"))
