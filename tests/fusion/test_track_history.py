"""What a track was seen in, and whether another one can have been in it: by place, by height, by its own boxes."""

import dataclasses
import math

import numpy as np
import pytest
from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.track_history import BoxObservation, TrackHistory, is_redundant, observe, where_redundant
from mcap_landmarks.geometry.se2 import Array

from tests.fusion.cylinders import Thing, boxes, camera_view

SIZE = Size(top_m=(0.9, 1.1), width_m=(0.2, 0.5), radius_m=0.4)
NOW = 10**6


def seen_at(bundle: int, bearing_rad: float = 0.0, sigma_rad: float = 0.02, tall: float = 0.2) -> BoxObservation:
    """A box in a direction, from a camera at the origin: of something 1 m tall, at 5 m."""
    return BoxObservation(bundle, "post", np.zeros(2), bearing_rad, sigma_rad, tall, np.zeros(2), np.inf)


def at(distance: float, bearing_rad: float = 0.0) -> Array:
    return distance * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])


def could_be(place: Array, box: BoxObservation, size: Size = SIZE) -> bool:
    return bool(TrackHistory(places={box.bundle: place}).could_be([box], size, NOW)[0])


def test_a_box_is_observed_in_the_odometry_frame() -> None:
    """The robot stands at (2, 3) and looks along y; the box's middle is a tenth of a radian to the left."""
    edges = 530.5 * np.tan([0.2, 0.0])
    found = box_geometry(
        camera_view(), np.array([[320 - edges[0], 240 - 106.1, 320 - edges[1], 240 + 53.05]]), FuseConfig()
    )
    box = observe(7, "post", 0, found, camera_view(), np.array([2.0, 3.0, np.pi / 2]), SIZE)
    assert (box.bundle, box.name) == (7, "post")
    np.testing.assert_allclose(box.camera_xy, [2.0, 3.1])
    assert box.bearing_rad == pytest.approx(np.pi / 2 + 0.1)
    assert box.sigma_rad == pytest.approx(np.hypot(0.01, 0.2 * 0.1))
    assert box.tall == pytest.approx(0.3 / np.hypot(1.0, np.tan(0.2) / 2))


def test_the_way_from_scan_to_image_counts() -> None:
    view = camera_view(velocity=(1.0, 0.0, 0.5), late_s=0.2)
    found = box_geometry(view, boxes([Thing("post", 4.0, 0.0)]), FuseConfig())
    box = observe(7, "post", 0, found, view, np.zeros(3), SIZE)
    ahead, aside = np.sin(0.1), np.cos(0.1)  # an arc of 0.1 rad about a point 2 m to the left
    np.testing.assert_allclose(box.camera_xy, [2 * ahead + 0.1 * aside, 2 * (1 - aside) + 0.1 * ahead])
    assert box.bearing_rad == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("corners", "is_wide", "is_tall"),
    [
        ([0.0, 99.0, 90.0, 300.0], True, True),
        ([550.0, 99.0, 640.0, 300.0], True, True),
        ([99.0, 0.0, 300.0, 90.0], False, False),
        ([99.0, 300.0, 300.0, 480.0], False, False),
    ],
    ids=["left", "right", "top", "bottom"],
)
def test_what_the_image_cuts_tells_less(corners: list[float], is_wide: bool, is_tall: bool) -> None:
    """A box cut at a side may have its middle anywhere; one cut above or below has no height."""
    found = box_geometry(camera_view(), np.array([corners]), FuseConfig())
    box = observe(7, "post", 0, found, camera_view(), np.zeros(3), SIZE)
    half = float(found.half[0])
    assert box.sigma_rad == pytest.approx(half if is_wide else np.hypot(0.01, 0.2 * half))
    assert (box.tall > 0) == is_tall
    assert np.isfinite(box.reach_m) == is_tall


def test_a_track_can_be_in_a_box_that_is_in_its_direction() -> None:
    """Within 2.65 sigmas of the box and of where the track is, which goes by its class's radius."""
    limit = 2.65 * math.hypot(0.02, 0.15 * 0.4 / 5)
    assert could_be(at(5, 0.3 + limit - 1e-4), seen_at(1, 0.3))
    assert not could_be(at(5, 0.3 + limit + 1e-4), seen_at(1, 0.3))
    assert could_be(at(5, 0.3 - limit + 1e-4), seen_at(1, 0.3))
    assert not could_be(at(5, 0.3 - limit - 1e-4), seen_at(1, 0.3))
    assert could_be(at(5, math.pi - 0.01), seen_at(1, -math.pi + 0.01))  # directions go round


def test_what_stands_on_the_camera_is_taken_for_a_hand_away() -> None:
    tall = seen_at(1, 0.0, 0.02, 0.0)
    assert could_be(np.array([0.0, 0.01]), tall)  # 0.15 * 0.4 / 0.1 rad, 2.65 times
    assert not could_be(np.array([0.0, 0.1]), tall, dataclasses.replace(SIZE, radius_m=0.35))


def test_a_track_can_be_in_a_box_that_is_as_tall_as_its_class() -> None:
    """A quarter more or less; 0.2 of the distance is 1 m at 5 m."""
    box = seen_at(1)
    distances = {4.5 / 1.25 - 0.01: False, 4.5 / 1.25 + 0.01: True, 5.5 * 1.25 - 0.01: True, 5.5 * 1.25 + 0.01: False}
    assert {distance: could_be(at(distance), box) for distance in distances} == distances
    cut = seen_at(1, tall=0.0)
    assert all(could_be(at(distance), cut) for distance in distances)
    lofty = dataclasses.replace(SIZE, top_m=(2.0, 6.0), foot_m=(1.0, 5.0), tall_m=(0.9, 1.2))
    assert [could_be(at(d), box, lofty) for d in (3.5, 3.7, 7.4, 7.6)] == [False, True, True, False]
    open_ended = dataclasses.replace(SIZE, top_m=(0.9, 1.1), foot_m=(-0.5, 0.0))
    assert [could_be(at(d), box, open_ended) for d in (9.9, 10.1)] == [True, False]


def test_a_track_with_a_box_of_its_own_in_the_image_was_not_in_another_one() -> None:
    own = TrackHistory(boxes=[seen_at(2)], places={1: at(5), 2: at(5)})
    assert own.could_be([seen_at(1), seen_at(2)], SIZE, NOW).tolist() == [True, False]
    other_camera = dataclasses.replace(seen_at(2), frame_id="rear")
    assert own.could_be([other_camera], SIZE, NOW).tolist() == [True]


def test_where_it_was_counts_and_else_where_it_is() -> None:
    walker = TrackHistory(places={1: at(5), 3: at(5, 0.5)})
    looks = [seen_at(1), seen_at(1, 0.5), seen_at(2), seen_at(2, 0.5), seen_at(9, 0.5)]
    assert walker.could_be(looks, SIZE, NOW).tolist() == [True, False, False, True, True]
    assert walker.could_be(looks, SIZE, 2).tolist() == [True, False, True, False, False]  # as of then
    assert walker.could_be(looks, SIZE, 0).tolist() == [False] * 5
    assert TrackHistory().could_be(looks, SIZE, NOW).tolist() == [False] * 5
    assert walker.could_be([], SIZE, NOW).tolist() == []


def test_boxes_and_places_of_long_ago_are_forgotten() -> None:
    history = TrackHistory()
    for bundle in range(50):
        history.note(seen_at(bundle))
    assert [box.bundle for box in history.boxes] == list(range(10, 50))
    for bundle in range(650):
        history.stood(bundle, at(5))
    assert list(history.places) == list(range(50, 650))


def track(bundles: range, bearing_rad: float = 0.0, *, distance: float = 5.0, until: int = 40) -> TrackHistory:
    """One that was there all the time, and has boxes in some bundles."""
    places = {bundle: at(distance, bearing_rad) for bundle in range(until)}
    return TrackHistory([seen_at(bundle, bearing_rad) for bundle in bundles], places)


def test_a_track_is_redundant_if_another_one_explains_its_boxes_and_more() -> None:
    """Both were in line at first, and one got the boxes; later the other one did, where that one was not."""
    behind = track(range(4, 10), 0.5)
    behind.places |= {bundle: at(5.5) for bundle in range(4)}
    before = track(range(4))
    assert is_redundant(before, behind, "post", SIZE, NOW)
    assert not is_redundant(behind, before, "post", SIZE, NOW)


@pytest.mark.parametrize(("theirs", "redundant"), [(0, False), (1, False), (2, True)])
def test_one_box_more_is_not_enough(theirs: int, redundant: bool) -> None:
    """It may be a wrong one."""
    other = track(range(10, 10 + theirs), 0.5)
    other.places |= {bundle: at(5.5) for bundle in range(10)}
    assert is_redundant(track(range(4)), other, "post", SIZE, NOW) == redundant


@pytest.mark.parametrize(("alone", "redundant"), [(3, True), (4, False)])
def test_a_few_boxes_need_not_be_explained(alone: int, redundant: bool) -> None:
    """15 % of twenty."""
    other = track(range(25, 35), 0.5)
    other.places |= {bundle: at(5.5) for bundle in range(20 - alone)}
    assert is_redundant(track(range(20)), other, "post", SIZE, NOW) == redundant


def test_the_other_must_have_more_that_this_one_cannot_have_been_in() -> None:
    """Three boxes of each cannot be of the other: neither explains the other."""
    other = track(range(25, 28), 0.5)
    other.places |= {bundle: at(5.5) for bundle in range(17)}
    assert not is_redundant(track(range(20)), other, "post", SIZE, NOW)


def test_only_boxes_of_the_class_count() -> None:
    behind, before = track(range(4, 10), 0.5), track(range(4))
    behind.places |= {bundle: at(5.5) for bundle in range(4)}
    before.boxes += [dataclasses.replace(seen_at(bundle, 1.5), name="bag") for bundle in range(20, 30)]
    assert is_redundant(before, behind, "post", SIZE, NOW)
    behind.boxes = [dataclasses.replace(box, name="bag") for box in behind.boxes]
    assert not is_redundant(before, behind, "post", SIZE, NOW)


def observed(thing: Thing, odometry: Array) -> BoxObservation:
    found = box_geometry(camera_view(), boxes([thing]), FuseConfig())
    return observe(1, "post", 0, found, camera_view(), odometry, SIZE)


@pytest.mark.parametrize("thing", [Thing("post", 5.0, 1.0), Thing("post", 9.0, -3.0), Thing("post", 2.5, 1.2)])
def test_all_that_can_be_in_a_box_is_within_its_reach(thing: Thing) -> None:
    box = observed(thing, np.array([3.0, -2.0, 0.7]))
    rng = np.random.default_rng(2)
    places = box.centre_xy + rng.uniform(-1.2, 1.2, (4000, 2)) * box.reach_m
    within = [place for place in places if could_be(place, box)]
    away = [float(np.hypot(*(place - box.centre_xy))) for place in within]
    assert len(within) > 50
    assert 0.9 * box.reach_m < max(away) <= box.reach_m  # and hardly anything else is


def test_wide_boxes_reach_all_around() -> None:
    """A direction that may be off by more than half a turn is none."""
    wide = dataclasses.replace(observed(Thing("post", 5.0, 0.0), np.zeros(3)), sigma_rad=2.0)
    found = box_geometry(camera_view(), boxes([Thing("post", 5.0, 0.0)]), FuseConfig())
    large = dataclasses.replace(SIZE, radius_m=60.0)
    box = observe(1, "post", 0, found, camera_view(), np.zeros(3), large)
    behind = box.camera_xy - at(6.0)
    assert could_be(behind, box, large)
    assert np.hypot(*(behind - box.centre_xy)) <= box.reach_m
    assert could_be(behind, wide)


def reaching(reach_m: float) -> BoxObservation:
    return dataclasses.replace(seen_at(1), centre_xy=np.array([reach_m, 0.0]), reach_m=reach_m)


def test_who_makes_a_track_redundant_was_where_its_nearest_boxes_reach() -> None:
    """In one of the four smallest of twenty, since three need not be explained; for one without boxes anywhere."""
    history = TrackHistory([reaching(float(reach)) for reach in (*range(20, 1, -1), 1)])
    circles = where_redundant(history, "post")
    assert [radius for _, radius in circles] == [1, 2, 3, 4]
    assert [centre[0] for centre, _ in circles] == [1, 2, 3, 4]
    assert [radius for _, radius in where_redundant(TrackHistory([reaching(3.0)]), "post")] == [3.0]
    assert [radius for _, radius in where_redundant(history, "bag")] == [np.inf]
