"""Maps and logs that cannot go together are told, and why."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.localization.validation import check_lengths, check_map, check_scale

from tests.localization.small_worlds import PLACE_CLASSES, PLACE_XY, landmark_map

WORLD = landmark_map(PLACE_XY, PLACE_CLASSES)


def test_a_map_needs_two_confirmed_landmarks_apart() -> None:
    check_map(WORLD)
    for count, words in ((5, "no confirmed landmarks"), (4, "one confirmed landmark")):
        with pytest.raises(MapError, match=words):
            check_map(replace(WORLD, tentative=np.arange(5) < count))
    check_map(replace(WORLD, tentative=np.arange(5) < 3))
    for apart_m, refused in ((9e-4, True), (1.1e-3, False)):
        close = landmark_map([[1.0, 1.0], [1.0, 1.0 + apart_m]], ("a", "b"))
        if refused:
            with pytest.raises(MapError, match="all 2 landmarks of the map lie in one place"):
                check_map(close)
        else:
            check_map(close)


@pytest.mark.parametrize(
    ("objects", "extent_m", "refused"),
    [
        ([[5.0, 0], [8, 4]], (2.0, 100.0), False),
        ([[5000.0, 0], [8000, 4000]], (2.0, 100.0), True),  # millimetres
        ([[450.0, 0], [490, 4]], (2.0, 100.0), False),  # far, but possible
        ([[600.0, 0], [600, 90]], (2.0, 100.0), False),  # beyond any sensor, but as far apart as the map is wide
        ([[600.0, 0], [600, 110]], (2.0, 100.0), True),
        ([[5.0, 0], [8, 4]], (2000.0, 1e5), True),  # the map is in millimetres
        ([[5.0, 0], [8, 4]], (190.0, 1000.0), False),  # a sparse map
        ([[5000.0, 0]], (2.0, 100.0), False),  # one object has no length
    ],
)
def test_lengths_of_a_bundle_and_of_the_map(
    objects: list[list[float]], extent_m: tuple[float, float], refused: bool
) -> None:
    if refused:
        with pytest.raises(MapError, match="one of them is not in metres"):
            check_lengths(np.array(objects), extent_m)
    else:
        check_lengths(np.array(objects), extent_m)


@pytest.mark.parametrize(("scale", "refused"), [(1.0, False), (150.0, False), (250.0, True), (1 / 250, True)])
def test_the_same_things_are_as_far_apart(scale: float, refused: bool) -> None:
    seen, mapped = [PLACE_XY, PLACE_XY], [scale * PLACE_XY, scale * PLACE_XY]
    if refused:
        with pytest.raises(MapError, match="times as far apart"):
            check_scale(seen, mapped)
        check_scale([PLACE_XY[:4]], [scale * PLACE_XY[:4]])  # three lengths are too few to say
    else:
        check_scale(seen, mapped)
