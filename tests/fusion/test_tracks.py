"""Tracks: how long they are remembered, what another look at one is worth, and where they are known to be."""

import numpy as np
import pytest
from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.class_belief import ClassBelief
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.tracks import Track, TrackTable

from tests.fusion.cylinders import THREE, Thing, believe, scanned, tracked

SECOND = 10**9
HERE = np.zeros(3)


def seeing(*things: Thing, config: FuseConfig | None = None) -> TrackTable:
    """Tracks 0, 1, ... of a first scan, each of its class."""
    objects = scanned(things, SECOND)
    table = tracked(objects, config)
    for i, thing in enumerate(things):
        believe(table, str(i), thing.name)
    table.place(objects, HERE)
    return table


def fresh(first: tuple[float, float, float], second: tuple[float, float, float]) -> float:
    """What the second look is worth: distance, bearing, heading of the robot."""
    track = Track(1, ClassBelief(FuseConfig()))
    looks = [(np.array([d * np.cos(b), d * np.sin(b)]), heading) for d, b, heading in (first, second)]
    assert track.freshness(*looks[0]) == 1
    return track.freshness(*looks[1])


def test_a_look_from_the_same_place_says_nothing_new() -> None:
    """But for a share: seven of them count as one from another place."""
    assert fresh((5.0, 0.3, 0.0), (5.0, 0.3, 0.0)) == 0.15
    assert fresh((5.0, 0.3, 0.0), (5.0, -0.2, 0.5)) == pytest.approx(0.15)  # the robot has turned on the spot
    assert fresh((5.0, 3.0, 0.0), (5.0, -3.2, 2 * np.pi - 0.083185)) == pytest.approx(0.15)  # and around


def test_a_look_from_another_side_or_distance_is_new() -> None:
    """By 0.035 rad, or a tenth of the distance, or some of each."""
    assert fresh((5.0, 0.3, 0.0), (5.0, 0.314, 0.0)) == pytest.approx(0.4)
    assert fresh((5.0, 0.3, 0.0), (5.0, 0.286, 0.0)) == pytest.approx(0.4)
    assert fresh((5.0, 0.3, 0.0), (5.0 * np.exp(0.05), 0.3, 0.0)) == pytest.approx(0.5)
    assert fresh((5.0, 0.3, 0.0), (5.0 * np.exp(-0.05), 0.314, 0.0)) == pytest.approx(0.9)
    assert fresh((5.0, 0.3, 0.0), (7.0, 0.5, 0.0)) == 1
    assert fresh((0.001, 0.3, 0.0), (0.1, 0.3, 0.0)) == 0.15  # so near that distances say nothing
    assert fresh((0.001, 0.3, 0.0), (0.1 * np.exp(0.05), 0.3, 0.0)) == pytest.approx(0.5)


def test_tracks_are_numbered_as_they_come_and_keep_their_number() -> None:
    table = seeing(*THREE)
    table.see(scanned(THREE[:1] * 2, 2 * SECOND, ["new", "0"]), alone=False)
    assert [table[name].number for name in ("0", "1", "2", "new")] == [1, 2, 3, 4]
    assert [table[name].bundle for name in ("0", "1", "new")] == [2, 1, 2]
    assert [table[name].seen_ns for name in ("0", "1", "new")] == [2 * SECOND, SECOND, 2 * SECOND]
    assert (table["0"].judged, table["new"].judged) == (1, 2)


def test_tracks_of_scans_without_odometry_begin_with_other_odds() -> None:
    table = TrackTable(FuseConfig(prior_odds=0.01, prior_odds_alone=0.2))
    table.see(scanned(THREE[:1], SECOND, ["a"]), alone=True)
    table.see(scanned(THREE[:1], SECOND, ["b"]), alone=False)
    assert [table[name].belief.share("person") for name in ("a", "b")] == pytest.approx([0.2 / 1.2, 0.01 / 1.01])


def test_what_no_scan_shows_for_a_thousand_bundles_is_forgotten() -> None:
    table = seeing(Thing("person", 5.0, 0.0))
    empty = scanned((), SECOND)
    for _ in range(999):
        table.see(empty, alone=False)
    assert "0" in table
    assert table.near([(np.array([5.0, 0.0]), 1.0)], SECOND) == ["0"]
    table.see(empty, alone=False)
    assert "0" not in table
    assert table.near([(np.array([5.0, 0.0]), 1.0)], SECOND) == []


def test_only_what_is_long_unseen_is_forgotten() -> None:
    table = seeing(*THREE)
    for _ in range(1000):
        table.see(scanned(THREE[:1], SECOND), alone=False)
    assert [name in table for name in ("0", "1", "2")] == [True, False, False]


def test_a_place_is_known_for_a_minute() -> None:
    table = seeing(Thing("person", 5.0, 0.0))
    assert [table.is_known("0", SECOND + after) for after in (60 * SECOND, 60 * SECOND + 1)] == [True, False]
    table["0"].place_xy = None
    assert not table.is_known("0", SECOND)


def test_tracks_near_some_places_are_told_oldest_first() -> None:
    table = seeing(Thing("person", 5.0, 0.0), Thing("suitcase", 30.0, 0.0), Thing("person", 60.0, 0.0))
    circles = [(np.array([60.0, 0.0]), 1.0), (np.array([5.0, 0.0]), 1.0)]
    assert table.near(circles, SECOND) == ["0", "2"]
    assert table.near(circles, 62 * SECOND) == []


def test_a_place_is_that_of_the_class_in_the_odometry_frame() -> None:
    """The centre that the scan gives the class, or the surface where it gives none."""
    person, vase = Thing("person", 5.0, 0.0), Thing("vase", 3.0, 0.0)
    objects = scanned((person, vase), SECOND)
    table = tracked(objects)
    believe(table, "0", "person")
    believe(table, "1", "vase")
    table.place(objects, np.array([1.0, 2.0, np.pi / 2]))
    np.testing.assert_allclose(table["0"].place_xy, [1.0, 7.0])
    np.testing.assert_allclose(table["1"].place_xy, [1.0, 2.0 + 2.8])
    np.testing.assert_allclose(table["0"].history.places[1], [1.0, 7.0])


def test_nothing_is_where_its_class_is_not_sure() -> None:
    """By `min_probability`; also what had a place before."""
    objects, table = scanned(THREE, SECOND), seeing(*THREE, config=FuseConfig(min_probability=0.7))
    believe(table, "0", "fire hydrant", 0.71)
    believe(table, "1", "person", 0.69)
    table["2"].belief.log_odds = {}
    table.place(objects, HERE)
    assert [table[name].place_xy is None for name in ("0", "1", "2")] == [False, True, True]


def test_no_class_is_no_place_even_if_none_need_be_sure() -> None:
    table = seeing(THREE[0], config=FuseConfig(min_probability=0.0))
    table["0"].belief.log_odds = {}
    table.place(scanned(THREE[:1], SECOND), HERE)
    assert table["0"].place_xy is None


def test_a_track_passes_on_all_that_is_known_of_it() -> None:
    table = seeing(Thing("person", 5.0, 0.0))
    table["0"].viewed = (0.1, 0.2)
    before = table["0"]
    table.see(scanned((Thing("person", 30.0, 0.0),), SECOND, ["heir"]), alone=False)
    table.pass_on("0", "heir")
    assert "0" not in table
    heir = table["heir"]
    assert (heir.belief, heir.viewed, heir.history) == (before.belief, (0.1, 0.2), before.history)
    assert heir.number == 2
    heir.place_xy = np.array([30.0, 0.0])
    assert table.near([(np.array([5.0, 0.0]), 1.0)], SECOND) == ["heir"]  # where its boxes were


def test_shapes_are_known_of_classes_that_any_scan_had() -> None:
    table = seeing(THREE[0])
    assert table.shaped == {"fire hydrant", "person", "suitcase", ""}


def test_a_centre_without_a_shape_is_as_far_behind_as_boxes_are_wide() -> None:
    """Else as its class usually is, if that is known."""
    table = seeing(Thing("vase", 3.0, 0.0), config=FuseConfig(sizes={"urn": Size((0.4, 0.6), (0.2, 0.4), 0.17)}))
    objects = scanned((Thing("vase", 3.0, 0.0),), SECOND)
    table["0"].belief.radii_m = {"vase": 0.33}
    places = [table.centre(objects, 0, name)[0][0] for name in ("vase", "urn", "box", "person")]
    assert places == pytest.approx([2.8 + 0.33, 2.8 + 0.17, 2.8, 2.8 + 0.25])
    spreads = [table.centre(objects, 0, name)[1][0, 0] for name in ("vase", "person")]
    assert spreads == pytest.approx([1e-4 + (0.3 * 0.33) ** 2, 1e-4])


def test_a_radius_is_that_of_the_class_or_else_of_the_boxes() -> None:
    table = seeing(Thing("person", 5.0, 0.0))
    table["0"].belief.radii_m = {"person": 0.9, "vase": 0.33}
    assert [table.radius_m("0", name) for name in ("person", "vase", "box")] == [0.25, 0.33, 0.0]
