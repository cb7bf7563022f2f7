"""Tracks that go on under another id, where the scan shows another part of an object or has lost it for a while."""

import dataclasses

import numpy as np
import pytest
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.inheritance import inherit
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry.se2 import Array

from tests.fusion.cylinders import Thing, believe, scanned, tracked

SECOND = 10**9
HERE = np.zeros(3)


def after(
    before: tuple[Thing, ...],
    now: tuple[Thing, ...],
    ids: list[str],
    *,
    seconds: float = 1.0,
    odometry: Array = HERE,
    config: FuseConfig | None = None,
) -> TrackTable:
    """Known tracks 0, 1, ... in the first scan; a second one some time later shows others."""
    first = scanned(before, SECOND)
    table = tracked(first, config)
    for i, thing in enumerate(before):
        believe(table, str(i), thing.name)
    table.place(first, HERE)
    second = scanned(now, SECOND + round(seconds * SECOND), ids)
    table.see(second, alone=False)
    inherit(table, second, odometry)
    return table


def class_of(table: TrackTable, name: str) -> str:
    return table[name].belief.best()[0]


PERSON = Thing("person", 5.0, 0.0)
"""Its surface is at 4.75 m, its centre at 5 m."""


def test_another_part_of_an_object_is_that_object() -> None:
    table = after((PERSON,), (Thing("person", 5.0, 0.2),), ["new"])
    assert class_of(table, "new") == "person"
    assert "0" not in table


@pytest.mark.parametrize(("aside", "inherits"), [(0.54, True), (0.56, False)])
def test_it_must_be_within_the_radius_and_a_little(aside: float, inherits: bool) -> None:
    """0.25 m and 0.3 m, from where its centre was to where the surface is."""
    surface_m = np.hypot(5.0, aside)
    ahead = np.array([5.0, aside]) / surface_m
    table = after((PERSON,), (Thing("person", *(ahead * (surface_m + 0.25))),), ["new"])
    assert (class_of(table, "new") == "person") == inherits
    assert ("0" in table) != inherits


def test_a_large_object_reaches_far() -> None:
    car = Thing("car", 8.0, 0.0)
    assert class_of(after((car,), (Thing("car", 8.0, 2.3),), ["new"]), "new") == "car"
    assert class_of(after((car,), (Thing("car", 8.0, 3.0),), ["new"]), "new") == ""


def test_the_way_of_the_robot_counts() -> None:
    moved = Thing("person", 3.0, 0.0)
    assert class_of(after((PERSON,), (moved,), ["new"], odometry=np.array([2.0, 0.0, 0.0])), "new") == "person"
    assert class_of(after((PERSON,), (moved,), ["new"]), "new") == ""


@pytest.mark.parametrize(("seconds", "inherits"), [(60.0, True), (60.1, False)])
def test_it_is_remembered_for_a_minute(seconds: float, inherits: bool) -> None:
    table = after((PERSON,), (PERSON,), ["new"], seconds=seconds)
    assert (class_of(table, "new") == "person") == inherits


def test_what_the_scan_still_shows_keeps_what_is_known_of_it() -> None:
    table = after((PERSON,), (PERSON, Thing("person", 5.0, 0.2)), ["0", "new"])
    assert [class_of(table, name) for name in ("0", "new")] == ["person", ""]


def test_what_has_a_name_of_its_own_takes_no_other() -> None:
    first, second = scanned((PERSON,), SECOND), scanned((PERSON,), 2 * SECOND, ["new"])
    table = tracked(first)
    believe(table, "0", "person")
    table.place(first, HERE)
    table.see(second, alone=False)
    believe(table, "new", "suitcase")
    inherit(table, second, HERE)
    assert class_of(table, "new") == "suitcase"
    assert "0" in table


def test_nothing_is_known_of_what_was_not_sure() -> None:
    first = scanned((PERSON,), SECOND)
    table = tracked(first)
    believe(table, "0", "person", 0.4)
    table.place(first, HERE)
    second = scanned((PERSON,), 2 * SECOND, ["new"])
    table.see(second, alone=False)
    inherit(table, second, HERE)
    assert class_of(table, "new") == ""


def test_the_nearest_pairs_go_first_and_each_once() -> None:
    """Two chairs' legs: the nearer one of each, whatever their order."""
    before = (Thing("person", 5.0, 0.0), Thing("suitcase", 5.0, 0.5))
    now = (Thing("person", 5.0, 0.3), Thing("person", 5.0, -0.1))
    table = after(before, now, ["left", "right"])
    assert [class_of(table, name) for name in ("left", "right")] == ["suitcase", "person"]
    table = after(before, now[::-1], ["right", "left"])
    assert [class_of(table, name) for name in ("left", "right")] == ["suitcase", "person"]


def test_one_object_goes_on_once() -> None:
    now = (Thing("person", 5.0, 0.1), Thing("person", 5.0, 0.3))
    table = after((PERSON,), now, ["near", "far"])
    assert [class_of(table, name) for name in ("near", "far")] == ["person", ""]
    table = after((PERSON,), now[::-1], ["far", "near"])
    assert [class_of(table, name) for name in ("near", "far")] == ["person", ""]


def test_one_new_track_is_one_object_only() -> None:
    """The other one stays where it was, for whoever comes."""
    table = after((PERSON, Thing("person", 5.0, 0.3)), (Thing("person", 5.0, 0.05),), ["new"])
    assert class_of(table, "new") == "person"
    assert ("0" in table, "1" in table) == (False, True)


def test_a_cluster_that_cannot_be_of_the_class_is_something_else() -> None:
    """A scan that knows shapes of persons, and a cluster that is bare surface."""
    first = scanned((PERSON,), SECOND)
    table = tracked(first)
    believe(table, "0", "person")
    table.place(first, HERE)
    second = scanned((PERSON,), 2 * SECOND, ["new"])
    bare = dataclasses.replace(
        second,
        hypotheses=((("", 1.0),),),
        positions_xy=(second.positions_xy[0][-1:],),
        covariances=(second.covariances[0][-1:],),
    )
    table.see(bare, alone=False)
    inherit(table, bare, HERE)
    assert class_of(table, "new") == ""
    assert "0" in table


def test_a_class_without_shapes_goes_on_in_any_cluster() -> None:
    vase = Thing("vase", 5.0, 0.0)
    first, second = scanned((vase,), SECOND), scanned((vase,), 2 * SECOND, ["new"])
    table = tracked(first)
    believe(table, "0", "vase")
    table["0"].belief.radii_m = {"vase": 0.2}
    table.place(first, HERE)
    table.see(second, alone=False)
    inherit(table, second, HERE)
    assert class_of(table, "new") == "vase"
