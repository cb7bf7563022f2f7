"""The camera's view: where things are to it when the image is taken, and whether the image has all of them."""

import numpy as np
import pytest

from tests.fusion.cylinders import camera_view

HALF_ANGLE = 320 / 530.5
"""Slope of the image's sides; those of its top and bottom are 240 / 530.5."""


def test_directions_are_as_unsure_as_clocks_and_turns() -> None:
    """Stamps may be 10 ms apart, and the turn between scan and image may be a tenth off."""
    assert camera_view(velocity=(0.3, 0.0, 0.5), late_s=0.2).heading_sigma_rad == pytest.approx(0.005 + 0.01)
    assert camera_view(velocity=(0.3, 0.0, -0.5), late_s=0.2).heading_sigma_rad == pytest.approx(0.005 + 0.01)
    assert camera_view(velocity=(0.3, 0.0, 0.0), late_s=0.2).heading_sigma_rad == 0


def test_places_are_those_at_the_images_time() -> None:
    """A quarter of a turn on the spot: what was ahead is to the right of the robot, and the camera looks elsewhere."""
    turned = camera_view(velocity=(0.0, 0.0, np.pi / 2), late_s=1.0)
    np.testing.assert_allclose(turned.from_camera(np.array([[4.0, 1.0]])), [[1.0 - 0.1, -4.0]], atol=1e-12)
    driven = camera_view(velocity=(2.0, 0.0, 0.0), late_s=0.5)
    np.testing.assert_allclose(driven.from_camera(np.array([[4.0, 1.0]])), [[4.0 - 1.0 - 0.1, 1.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("place", "half_width", "height", "shown"),
    [
        ((5.1, 0.0), 0.3, 0.2, True),
        ((5.1, 5 * HALF_ANGLE - 0.37), 0.3, 0.2, True),
        ((5.1, 5 * HALF_ANGLE - 0.33), 0.3, 0.2, False),  # a side reaches beyond the image's
        ((5.1, -5 * HALF_ANGLE + 0.37), 0.3, 0.2, True),
        ((5.1, -5 * HALF_ANGLE + 0.33), 0.3, 0.2, False),
        ((5.1, 0.0), 0.3, 0.2 + 5 * 240 / 530.5 - 0.01, True),
        ((5.1, 0.0), 0.3, 0.2 + 5 * 240 / 530.5 + 0.01, False),  # above the image
        ((0.8, 0.0), 0.3, 0.2 - 0.7 * 240 / 530.5 + 0.01, True),
        ((0.8, 0.0), 0.3, 0.2 - 0.7 * 240 / 530.5 - 0.01, False),  # below it
        ((-5.0, 0.0), 0.3, 0.2, False),  # behind the camera
        ((0.3, 0.0), 0.3, 0.2, False),  # so near that it is all around
    ],
)
def test_an_image_shows_what_it_has_the_whole_width_of(
    place: tuple[float, float], half_width: float, height: float, shown: bool
) -> None:
    assert camera_view().shows(np.array(place), half_width, height) == shown


def test_what_the_image_shows_depends_on_when_it_is_taken() -> None:
    """Turned to the left by half a radian, it has what was beyond its left side, and what was ahead no more."""
    turned = camera_view(velocity=(0.0, 0.0, 0.5), late_s=1.0)
    beside, ahead = 5 * np.array([np.cos(0.7), np.sin(0.7)]), 5 * np.array([np.cos(-0.2), np.sin(-0.2)])
    assert [view.shows(beside, 0.1, 0.2) for view in (camera_view(), turned)] == [False, True]
    assert [view.shows(ahead, 0.1, 0.2) for view in (camera_view(), turned)] == [True, False]
