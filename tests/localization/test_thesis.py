"""The thesis's own way: three objects, left to right, whose classes are those of a group; the last match wins."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.thesis import locate_as_in_the_thesis
from mcap_landmarks.maps.model import Group
from mcap_landmarks.messages.match import Status

from tests.localization.small_worlds import landmark_map, seen

XY = np.array([[8.0, 2.0], [9.0, 0.0], [8.5, -2.0], [48.0, 2.0], [49.0, 0.0], [48.0, -2.0]])
CLASSES = ("bench", "person", "hydrant") * 2
FIRST = Group(("l0", "l1", "l2"), np.zeros(3))
LAST = Group(("l3", "l4", "l5"), np.zeros(3))
WORLD = replace(landmark_map(XY, CLASSES), groups=(FIRST,))
CONFIG = LocalizeConfig(method="thesis", thesis_guess_m=(1.0, 0.5))
POSE = np.array([0.5, 0.2, 0.1])


def located(rows: list[int], pose: Array = POSE, groups: tuple[Group, ...] = (FIRST,)) -> Match:
    return locate_as_in_the_thesis([seen(WORLD, pose, rows)], replace(WORLD, groups=groups), CONFIG)[0]


def test_objects_are_ordered_from_left_to_right() -> None:
    match = located([2, 0, 1])
    assert match.message.status is Status.LOCALIZED
    assert match.message.object_ids == ("1", "2", "0")
    assert match.message.landmark_ids == ("l0", "l1", "l2")
    assert match.pose == pytest.approx([0.5, 0.2, 0.0], abs=1e-3)
    assert match.covariance is None
    assert match.message.residual_m == pytest.approx(np.zeros(3), abs=1e-3)


@pytest.mark.parametrize(
    ("rows", "status"),
    [([0, 1], Status.TOO_FEW_OBJECTS), ([0, 1, 2, 3], Status.NO_MATCH), ([0, 1, 4], Status.NO_MATCH)],
)
def test_anything_else_is_refused(rows: list[int], status: Status) -> None:
    match = located(rows)
    assert match.message.status is status
    assert match.pose is None


def test_of_groups_with_the_same_classes_the_last_one_wins() -> None:
    """Wrongly so, which is why the default refuses."""
    match = located([0, 1, 2], groups=(FIRST, LAST))
    assert match.message.landmark_ids == ("l3", "l4", "l5")
