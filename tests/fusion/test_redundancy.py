"""Tracks whose boxes were of another one: judged at images, of what is in the scan, by tracks that count themselves."""

import math

import numpy as np
import pytest
from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.redundancy import RedundancyCheck
from mcap_landmarks.fusion.track_history import BoxObservation
from mcap_landmarks.fusion.tracks import TrackTable

from tests.fusion.cylinders import Thing, believe, scanned, tracked

SECOND = 10**9
CONFIG = FuseConfig(sizes={"post": Size(top_m=(0.9, 1.1), width_m=(0.2, 0.5), radius_m=0.2)})


def box(bundle: int, bearing_rad: float, name: str = "post") -> BoxObservation:
    """Of something 1 m tall at 5 m, in a direction from the origin."""
    ahead = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    return BoxObservation(bundle, name, np.zeros(2), bearing_rad, 0.02, 0.2, 5 * ahead, 3.0)


def posts(*bearings_rad: float, class_name: str = "post") -> TrackTable:
    """Tracks 0, 1, ... of a class, each at 5 m in some direction."""
    things = [Thing("post", 5 * math.cos(bearing), 5 * math.sin(bearing)) for bearing in bearings_rad]
    objects = scanned(things, SECOND)
    table = tracked(objects, CONFIG)
    for name in objects.ids:
        believe(table, name, class_name)
    table.place(objects, np.zeros(3))
    return table


def boxes_of(table: TrackTable, name: str, bearing_rad: float, bundles: range) -> None:
    table[name].history.boxes += [box(bundle, bearing_rad) for bundle in bundles]


def judged(table: TrackTable, *names: str, stamp_ns: int = SECOND) -> list[bool]:
    RedundancyCheck(table).at_image(names, stamp_ns)
    return [table[name].is_redundant for name in names]


def in_line() -> TrackTable:
    """Track 0 has boxes that track 1 explains, beside others of its own; 0.1 rad are half a metre."""
    table = posts(0.05, 0.0)
    boxes_of(table, "0", 0.02, range(10, 14))
    boxes_of(table, "1", -0.1, range(20, 26))
    table["1"].history.places |= {bundle: np.array([5.0, 0.1]) for bundle in range(10, 14)}
    return table


def test_what_another_track_explains_is_redundant() -> None:
    assert judged(in_line(), "0", "1") == [True, False]


def test_only_what_is_asked_for_is_judged() -> None:
    table = in_line()
    assert judged(table, "1") == [False]
    assert not table["0"].is_redundant


def test_tracks_of_another_class_explain_nothing() -> None:
    table = in_line()
    believe(table, "1", "person")
    assert judged(table, "0") == [False]


def test_a_track_that_is_not_known_is_not_judged() -> None:
    table = in_line()
    table["0"].place_xy = None
    assert judged(table, "0") == [False]


def test_a_track_that_was_not_seen_lately_explains_nothing() -> None:
    table = in_line()
    table["0"].seen_ns = 60 * SECOND
    assert judged(table, "0", stamp_ns=61 * SECOND) == [True]
    assert judged(table, "0", stamp_ns=61 * SECOND + 1) == [False]


def test_a_track_that_is_far_from_all_boxes_explains_nothing() -> None:
    """Even one without boxes of its own, which every track of its class makes redundant, is compared with all."""
    table = posts(0.0, 1.0)
    boxes_of(table, "1", 1.0, range(10, 14))
    assert judged(table, "0") == [True]
    boxes_of(table, "0", 0.0, range(20, 24))
    assert judged(table, "0") == [False]


def chain(numbers: tuple[int, int, int]) -> list[bool]:
    """The middle one explains the first one, and the last one the middle one; they came in some order."""
    table = posts(0.0, 0.0, 0.0)
    first, middle, last = (str(number) for number in numbers)
    boxes_of(table, first, 0.0, range(10, 14))
    boxes_of(table, middle, 0.8, range(20, 24))
    boxes_of(table, last, -0.8, range(30, 36))
    here, left, right = (np.array([5 * math.cos(b), 5 * math.sin(b)]) for b in (0.0, 0.8, -0.8))
    for name, place in ((first, here), (middle, left), (last, right)):
        table[name].history.places = {1: place}
    table[first].history.places |= dict.fromkeys(range(10, 14), here)
    table[middle].history.places |= dict.fromkeys(range(10, 14), here)
    table[middle].history.places |= dict.fromkeys(range(20, 24), left)
    table[last].history.places |= dict.fromkeys(range(20, 24), left)
    for name in (first, middle, last):
        for place in (here, left, right):
            table.grid.add(name, place)
    return judged(table, first, middle, last)


def test_an_earlier_track_that_is_redundant_itself_makes_no_other_one_so() -> None:
    """Its boxes are of a third one, which does not explain those of the first."""
    assert chain((1, 0, 2)) == [False, True, False]


def test_a_later_track_counts_whatever_it_is_found_to_be() -> None:
    assert chain((0, 1, 2)) == [True, True, False]


def test_what_comes_back_without_an_image_is_judged_as_of_the_last_one() -> None:
    table = in_line()
    check = RedundancyCheck(table)
    table.see(scanned((), SECOND), alone=False)
    check.at_image([], SECOND)
    assert not table["0"].is_redundant
    boxes_of(table, "1", -0.1, range(30, 31))
    check.between_images(["0", "unknown"])
    assert table["0"].is_redundant
    assert table["0"].judged == 2


@pytest.mark.parametrize("moved", [False, True])
def test_where_tracks_have_gone_since_the_last_image_does_not_count(moved: bool) -> None:
    """Track 1 was elsewhere all the time, and now is where it would explain the boxes."""
    table = posts(0.05, 0.9)
    boxes_of(table, "0", 0.02, range(10, 14))
    boxes_of(table, "1", -0.1, range(20, 26))
    table.grid.add("1", np.array([5.0, 0.1]))
    check = RedundancyCheck(table)
    table.see(scanned((), SECOND), alone=False)
    if moved:
        table["1"].history.stood(2, np.array([5.0, 0.1]))
    check.at_image([], SECOND)
    table["1"].history.stood(3, np.array([5.0, 0.1]))
    check.between_images(["0"])
    assert table["0"].is_redundant == moved


def test_what_was_judged_at_the_last_image_is_not_judged_again_without_one() -> None:
    table = in_line()
    check = RedundancyCheck(table)
    check.at_image(["0"], SECOND)
    table["0"].is_redundant = False
    check.between_images(["0"])
    assert not table["0"].is_redundant
