"""Boxes as directions, and how badly they fit objects: each measure that may speak against a pair, on its own."""

import dataclasses

import numpy as np
import pytest
from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import BoxGeometry, box_geometry, misfits
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.se2 import Array

from tests.fusion.cylinders import camera_view

F = 530.5
CONFIG = FuseConfig(edge_px=3.0, edge_share=0.05, bearing_sigma_deg=0.4, lateral_m=0.06)
BEARING = np.deg2rad(0.4)
ANY = Size(top_m=(0.0, 100.0), width_m=(0.0, 100.0), radius_m=0.2, foot_m=(-100.0, 100.0))
"""Of which no box is too large or too small."""


def box(left: float, top: float, right: float, bottom: float) -> Array:
    """A box by the slopes of its edges, left and upwards positive."""
    return np.array([320 - F * left, 240 - F * top, 320 - F * right, 240 - F * bottom])


def seen(*boxes: Array, camera_m: float = 0.2) -> BoxGeometry:
    return box_geometry(camera_view(camera_m), np.array(boxes), CONFIG)


def misfit(
    found: BoxGeometry, size: Size, *places: tuple[float, float], spread: Array | None = None, camera_m: float = 0.2
) -> tuple[Array, Array, Array]:
    """What one box says of objects at places from the camera, which stands at x = 0.1 m."""
    centres = np.array(places) + np.array([0.1, 0.0])
    covariances = np.tile(np.zeros((2, 2)) if spread is None else spread, (len(places), 1, 1))
    return misfits(camera_view(camera_m), found, 0, (centres, covariances), size, CONFIG)


def test_a_box_is_bearings_and_slopes() -> None:
    one = seen(box(0.5, 0.2, 0.1, -0.3))
    assert (one.left[0], one.right[0]) == pytest.approx((np.arctan(0.5), np.arctan(0.1)))
    assert one.middle[0] == pytest.approx((np.arctan(0.5) + np.arctan(0.1)) / 2)
    assert one.half[0] == pytest.approx((np.arctan(0.5) - np.arctan(0.1)) / 2)
    aside = np.hypot(1.0, 0.3)  # slopes are against the distance on the ground, in the middle of the box
    assert (one.top[0], one.bottom[0]) == pytest.approx((0.2 / aside, -0.3 / aside))


def test_edges_are_as_unsure_as_pixels_and_size_say() -> None:
    one = seen(box(0.5, 0.2, 0.1, -0.3))
    wide, high = 0.4 * F, 0.5 * F
    assert one.sigma_rad[0] == pytest.approx(2 * one.half[0] / wide * np.hypot(3.0, 0.05 * wide))
    assert one.sigma_slope[0] == pytest.approx((one.top[0] - one.bottom[0]) / high * np.hypot(3.0, 0.05 * high))
    thin = seen(np.array([300.0, 100.0, 300.4, 100.3]))
    assert thin.sigma_rad[0] == pytest.approx(2 * thin.half[0] * np.hypot(3.0, 0.05))  # as if it were one pixel wide
    assert thin.sigma_slope[0] == pytest.approx((thin.top[0] - thin.bottom[0]) * np.hypot(3.0, 0.05))


def test_edges_near_the_images_are_cut() -> None:
    inside = seen(np.array([2.6, 2.6, 637.4, 477.4]))
    assert inside.cut.tolist() == [[False] * 4]
    each = seen(*(np.array(b) for b in ([2.5, 9, 99, 99], [9, 2.5, 99, 99], [9, 9, 637.5, 99], [9, 9, 99, 477.5])))
    assert each.cut.tolist() == np.eye(4, dtype=bool).tolist()


def test_a_box_covers_bearings_of_its_width_and_a_margin() -> None:
    two = seen(box(0.3, 0.1, 0.1, -0.1), box(-0.3, 0.1, -0.5, -0.1))
    left, both = np.array([True, False]), np.array([True, True])
    assert two.covers(np.arctan(0.3) + 0.01, 0.011, left)
    assert not two.covers(np.arctan(0.3) + 0.01, 0.009, left)
    assert two.covers(np.arctan(0.1) - 0.01, 0.011, left)
    assert not two.covers(np.arctan(0.1) - 0.01, 0.009, left)
    assert not two.covers(-0.4, 0.0, left)
    assert two.covers(-0.4, 0.0, both)


def test_aside_is_in_sigmas_of_all_that_errs() -> None:
    """Box's edges, how objects stand in boxes, the bearing, the object's own covariance across, and its parts."""
    found = seen(box(0.1, 0.1, -0.1, -0.1))
    half, edge = np.arctan(0.1), found.sigma_rad[0]
    own = BEARING**2 + (0.04**2 + 0.06**2) / (25 + 0.36)
    expected = np.sqrt(own + edge**2 / 2 + (0.2 * half) ** 2)
    along = np.array([5.0, 0.6]) / np.hypot(5.0, 0.6)
    across = np.array([-along[1], along[0]])
    spread = 9.0 * np.outer(along, along) + 0.04**2 * np.outer(across, across)
    aside, sigma, upright = misfit(found, ANY, (5.0, 0.6), spread=spread)
    assert sigma[0] == pytest.approx(expected, rel=1e-9)
    assert aside[0] == pytest.approx(np.arctan(0.12) / expected, rel=1e-9)
    assert upright[0] == 0


def test_a_turn_since_the_scan_makes_bearings_unsure_and_turns_covariances() -> None:
    """At a quarter of a turn what was across is along."""
    view = camera_view(velocity=(0.0, 0.0, np.pi / 2), late_s=1.0)
    found = box_geometry(view, np.array([box(0.1, 0.1, -0.1, -0.1)]), CONFIG)
    centre = np.array([[0.0, 5.1]])  # ahead of the robot by then
    spread = np.diag([0.04**2, 9.0])[None]
    _, sigma, _ = misfits(view, found, 0, (centre, spread), ANY, CONFIG)
    turn = 0.01 * np.pi / 2 + 0.1 * np.pi / 2
    own = BEARING**2 + turn**2 + (0.04**2 + 0.06**2) / 25
    expected = np.sqrt(own + found.sigma_rad[0] ** 2 / 2 + (0.2 * np.arctan(0.1)) ** 2)
    assert sigma[0] == pytest.approx(expected, rel=1e-9)


def test_a_camera_may_look_back() -> None:
    """Where bearings go round."""
    view = camera_view()
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    back = CameraView(view.camera, turn @ view.base_from_camera, view.scan_from_image, 0.0)
    boxes = np.array([box(0.1, 0.1, -0.1, -0.1)])
    found = box_geometry(back, boxes, CONFIG)
    assert abs(found.middle[0]) == pytest.approx(np.pi)
    assert found.half[0] == pytest.approx(np.arctan(0.1))
    centres = np.array([[-5.1, 0.6], [-5.1, -0.6]]), np.zeros((2, 2, 2))
    aside, _, _ = misfits(back, found, 0, centres, ANY, CONFIG)
    expected, _, _ = misfit(seen(boxes[0]), ANY, (5.0, -0.6), (5.0, 0.6))
    np.testing.assert_allclose(aside, expected)
    assert found.covers(np.pi - 0.05, 0.0, np.array([True]))
    assert found.covers(0.05 - np.pi, 0.0, np.array([True]))


def cut_box(*, left: bool = False, right: bool = False) -> BoxGeometry:
    return dataclasses.replace(seen(box(0.1, 0.1, -0.1, -0.1)), cut=np.array([[left, False, right, False]]))


@pytest.mark.parametrize("left", [True, False])
def test_what_the_image_cuts_stands_half_its_width_from_the_free_edge(left: bool) -> None:
    """Or farther, if so much shows, and at most half its largest width."""
    found, side = cut_box(left=left, right=not left), 1.0 if left else -1.0
    half, least, most = np.arctan(0.1), np.arctan(1.5 / 5), np.arctan(2.5 / 5)
    size = dataclasses.replace(ANY, width_m=(3.0, 5.0))
    bearings = [-half + least - 0.05, -half + least, -half + most, -half + most + 0.05]
    places = [(5 * np.cos(side * b), 5 * np.sin(side * b)) for b in bearings]
    aside, sigma, _ = misfit(found, size, *places)
    expected = np.sqrt(BEARING**2 + 0.06**2 / 25 + found.sigma_rad[0] ** 2)
    assert sigma == pytest.approx([expected] * 4)
    assert aside == pytest.approx(np.array([-0.05, 0.0, 0.0, 0.05]) * side / expected, abs=1e-9)
    narrow = dataclasses.replace(ANY, width_m=(0.2, 0.3))
    aside, _, _ = misfit(found, narrow, (5.0, 0.0), (5 * np.cos(0.05), 5 * np.sin(side * 0.05)))
    assert aside == pytest.approx(np.array([0.0, 0.05]) * side / expected, abs=1e-9)


def test_what_the_image_cuts_on_both_sides_is_anywhere_within() -> None:
    found = cut_box(left=True, right=True)
    own = np.sqrt(BEARING**2 + 0.06**2 / 25)
    places = [(5 * np.cos(b), 5 * np.sin(b)) for b in (0.09, -0.09, 0.12, -0.12)]
    aside, sigma, _ = misfit(found, ANY, *places)
    assert aside == pytest.approx([0.0, 0.0, 0.12 / own, -0.12 / own])
    assert sigma == pytest.approx([own + np.arctan(0.1)] * 4)


TALL = box(0.1, 0.2, -0.1, -0.1)
"""At 5 m, from a camera 0.5 m high: 1.0 m wide, from the ground up to 1.5 m."""
HIGH, WIDE = (np.hypot(3.0, 0.05 * n) for n in (0.3 * F, 0.2 * F))
UNSURE = np.hypot(5.0 * HIGH / F, 0.05)
"""Of heights at 5 m, from pixels and the ground."""
BLURRED = np.hypot(2 * 5.0 * 2 * np.arctan(0.1) / (0.2 * F) * WIDE, 0.05)
"""Of widths."""


def upright(size: Size, found: BoxGeometry | None = None) -> float:
    found = found or seen(TALL, camera_m=0.5)
    return float(misfit(found, size, (5.0, 0.0), camera_m=0.5)[2][0])


def cut(left: bool = False, top: bool = False, right: bool = False, bottom: bool = False) -> BoxGeometry:
    return dataclasses.replace(seen(TALL, camera_m=0.5), cut=np.array([[left, top, right, bottom]]))


def test_a_box_of_the_right_size_fits() -> None:
    fits = Size(top_m=(1.4, 1.6), width_m=(0.9, 1.1), radius_m=0.5, foot_m=(-0.1, 0.1), tall_m=(1.4, 1.6))
    assert upright(fits) == 0


def test_heights_and_widths_count_by_how_far_they_are_off() -> None:
    """In sigmas: those of the box, and what classes and hidden parts add."""
    replace = dataclasses.replace
    low, lofty = replace(ANY, top_m=(0.0, 1.2)), replace(ANY, top_m=(1.8, 9.0))
    assert upright(low) == pytest.approx((0.3 / (UNSURE + 0.07 * 1.2)) ** 2)
    assert upright(lofty) == pytest.approx((0.3 / (UNSURE + 0.07 * 1.8)) ** 2)
    assert upright(replace(ANY, foot_m=(0.3, 9.0))) == pytest.approx((0.3 / UNSURE) ** 2)
    assert upright(replace(ANY, foot_m=(-9.0, -0.3))) == pytest.approx((0.3 / (UNSURE + 0.25)) ** 2)
    assert upright(replace(ANY, tall_m=(0.0, 1.2))) == pytest.approx((0.3 / (1.4 * UNSURE)) ** 2)
    assert upright(replace(ANY, tall_m=(1.8, 9.0))) == pytest.approx((0.3 / (1.4 * UNSURE + 0.25)) ** 2)
    assert upright(replace(ANY, width_m=(0.0, 0.8))) == pytest.approx((0.2 / BLURRED) ** 2)
    assert upright(replace(ANY, width_m=(1.2, 9.0))) == pytest.approx((0.2 / (BLURRED + 0.35 * 1.2)) ** 2)


def test_misfits_of_a_box_add_up() -> None:
    replace = dataclasses.replace
    parts = [
        {"top_m": (0.0, 1.2)},
        {"width_m": (0.0, 0.8)},
        {"foot_m": (0.3, 9.0)},
        {"tall_m": (0.0, 1.2)},
    ]
    both = upright(replace(ANY, top_m=(0.0, 1.2), width_m=(0.0, 0.8), foot_m=(0.3, 9.0), tall_m=(0.0, 1.2)))
    assert both == pytest.approx(sum(upright(replace(ANY, **part)) for part in parts))
    others = [{"top_m": (1.8, 9.0)}, {"width_m": (1.2, 9.0)}, {"foot_m": (-9.0, -0.3)}, {"tall_m": (1.8, 9.0)}]
    both = upright(replace(ANY, top_m=(1.8, 9.0), width_m=(1.2, 9.0), foot_m=(-9.0, -0.3), tall_m=(1.8, 9.0)))
    assert both == pytest.approx(sum(upright(replace(ANY, **part)) for part in others))


def test_what_the_image_cuts_may_be_larger_than_it_shows() -> None:
    replace = dataclasses.replace
    lofty, sunk = replace(ANY, top_m=(1.8, 9.0)), replace(ANY, foot_m=(0.3, 9.0))
    tall, flat, wide = (
        replace(ANY, tall_m=(1.8, 9.0)),
        replace(ANY, tall_m=(0.0, 1.2)),
        replace(ANY, width_m=(1.2, 9.0)),
    )
    assert (upright(lofty, cut(top=True)), upright(lofty, cut(bottom=True)) > 0) == (0, True)
    assert (upright(sunk, cut(bottom=True)), upright(sunk, cut(top=True)) > 0) == (0, True)
    for size in (tall, flat):
        assert [upright(size, cut(top=True)), upright(size, cut(bottom=True))] == [0, 0]
    assert [upright(wide, cut(left=True)), upright(wide, cut(right=True))] == [0, 0]


def test_what_the_image_shows_is_never_larger_than_the_class_is() -> None:
    replace = dataclasses.replace
    everywhere = cut(left=True, top=True, right=True, bottom=True)
    assert upright(replace(ANY, top_m=(0.0, 1.2)), everywhere) > 0
    assert upright(replace(ANY, width_m=(0.0, 0.8)), everywhere) > 0
    assert upright(replace(ANY, foot_m=(-9.0, -0.3)), everywhere) > 0


def test_nothing_is_nearer_than_a_hand() -> None:
    """What stands on the camera is taken for 5 cm away."""
    aside, sigma, above = misfit(seen(box(0.1, 0.1, -0.1, -0.1)), ANY, (0.0, 0.0))
    assert np.isfinite([*aside, *sigma, *above]).all()
    assert sigma[0] == pytest.approx(0.06 / 0.05, rel=0.01)


def test_behind_an_edge_that_something_hides_an_object_goes_on_as_far_as_that_reaches() -> None:
    near, behind = box(0.3, 0.1, 0.1, -0.2), box(0.2, 0.05, 0.0, -0.1)
    aside, above, cut = box(-0.2, 0.05, -0.3, -0.1), box(0.15, 0.4, 0.12, 0.15), box(0.7, 0.05, 0.4, -0.1)
    slack_rad = seen(near, behind, aside, above, cut).slack_rad
    hidden = np.arctan(0.3) - np.arctan(0.2)
    np.testing.assert_allclose(slack_rad, [[0, 0], [hidden, 0], [0, 0], [0, 0], [np.inf, 0]], atol=1e-9)
