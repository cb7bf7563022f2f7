"""Bundles as a sequence: identical places stay ambiguous, and a robot is followed, lost and found again."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import Array, compose
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import matcher, odometry, one_place, seen, two_places

POSE = np.array([-4.0, 1.0, 0.1])
UNKNOWN_XY = np.array([[3.0, 8.0], [5.0, -7.0], [1.0, -9.0]])


def sequence(world: LandmarkMap, length_m: float = 30.0) -> SequenceLocalizer:
    return SequenceLocalizer(matcher(world), OdometryNoise(), length_m)


def driven(localizer: SequenceLocalizer, world: LandmarkMap, poses: Array, rows: list[range]) -> list[Match]:
    """Bundles of some landmarks each along poses half a metre apart; odometry starts at zero, and is exact."""
    found = []
    for i, (pose, which) in enumerate(zip(poses, rows, strict=True)):
        at = compose(np.array([0.0, 0.0, 0.0]), np.array([0.5 * i, 0.0, 0.0]))
        found.append(localizer.localize(seen(world, pose, which, stamp_ns=i), odometry(at, 0.5 * i)))
    return found


def ahead(count: int) -> Array:
    return np.array([compose(POSE, np.array([0.5 * i, 0.0, 0.0])) for i in range(count)])


def statuses(found: list[Match]) -> list[Status]:
    return [match.message.status for match in found]


def test_a_sequence_past_one_of_two_identical_places_stays_ambiguous_until_something_tells_them_apart() -> None:
    world = two_places()
    only_here = world.positions_xy.copy()
    only_here[10] = [2.0, -2.5]  # one of the far landmarks, brought beside the first place
    world = replace(world, positions_xy=only_here)
    found = driven(sequence(world), world, ahead(10), [range(5)] * 8 + [range(5), range(4, 11, 6)])
    assert statuses(found) == [Status.AMBIGUOUS] * 9 + [Status.LOCALIZED]
    assert found[-1].pose == pytest.approx(ahead(10)[-1], abs=0.01)
    assert [match.message.bundles_joined for match in found] == list(range(1, 11))


def test_objects_of_several_bundles_are_matched_together() -> None:
    """No bundle has more than two objects; only all together are a place."""
    world = one_place()
    found = driven(sequence(world), world, ahead(4), [range(2), range(1, 3), range(2, 4), range(3, 5)])
    assert statuses(found) == [Status.AMBIGUOUS, Status.LOCALIZED, Status.LOCALIZED, Status.LOCALIZED]
    assert found[-1].pose == pytest.approx(ahead(4)[-1], abs=0.01)


def unknown(count: int = 3) -> SceneObjects:
    return replace(seen(one_place(), POSE, range(count)), positions_xy=UNKNOWN_XY[:count])


def test_a_robot_that_was_carried_away_is_lost_and_found_again() -> None:
    """The wheels stand still meanwhile: only that nothing matches any more tells."""
    world = one_place()
    there = np.array([64.0, 60.0, 1.0])
    near = np.flatnonzero(np.linalg.norm(world.positions_xy - there[:2], axis=1) < 7)
    localizer = sequence(world)
    scenes = [seen(world, POSE, range(5))] * 3 + [unknown()] * 4 + [seen(world, there, near)] * 3
    found = [localizer.localize(scene, odometry([0, 0, 0], 0.0)) for scene in scenes]
    expected = [Status.LOCALIZED] * 3 + [Status.NO_MATCH] * 5 + [Status.AMBIGUOUS, Status.LOCALIZED]
    assert statuses(found) == expected
    assert found[-1].pose == pytest.approx(there, abs=0.01)


def test_wheels_that_slip_do_not_lose_the_place() -> None:
    world = one_place()
    localizer = sequence(world)
    first = localizer.localize(seen(world, POSE, range(5)), odometry([0, 0, 0], 0.0))
    short = compose(POSE, np.array([0.2, 0.0, 0.0]))  # of the metre that the wheels turned
    then = localizer.localize(seen(world, short, range(5)), odometry([1.0, 0, 0], 1.0))
    assert statuses([first, then]) == [Status.LOCALIZED] * 2
    assert then.pose == pytest.approx(short, abs=0.02)
    assert len(then.message.object_ids) == 5


def test_without_odometry_a_sequence_begins_anew() -> None:
    world = one_place()
    localizer = sequence(world)
    driven(localizer, world, ahead(3), [range(5)] * 3)
    alone = localizer.localize(seen(world, POSE, range(2)), None)
    assert (alone.message.status, alone.message.bundles_joined) == (Status.AMBIGUOUS, 1)
    after = localizer.localize(seen(world, POSE, range(2)), odometry([9.0, 9.0, 0.0], 90.0))
    assert (after.message.status, after.message.bundles_joined) == (Status.AMBIGUOUS, 1)


def test_bundles_count_over_the_length_of_a_sequence() -> None:
    world = one_place()
    found = driven(sequence(world, 1.0), world, ahead(6), [range(5), range(5), range(5), range(0), range(5), range(5)])
    assert [match.message.bundles_joined for match in found] == [1, 2, 3, 2, 2, 2]
    assert found[3].message.status is Status.TOO_FEW_OBJECTS


def test_a_tracked_bundle_of_one_object_is_too_few() -> None:
    world = one_place()
    found = driven(sequence(world), world, ahead(3), [range(5), range(1), range(5)])
    assert statuses(found) == [Status.LOCALIZED, Status.TOO_FEW_OBJECTS, Status.LOCALIZED]
    assert found[1].message.landmark_ids == ("l0",)


def test_odds_are_asked_of_a_tracked_place_too() -> None:
    """A place that is accepted with odds above what is asked is not localized, however well it fits."""
    world = one_place()
    strict = SequenceLocalizer(matcher(world, LocalizeConfig(accidental=1e-12)), OdometryNoise(), 30.0)
    found = driven(strict, world, ahead(3), [range(5)] * 3)
    assert statuses(found) == [Status.AMBIGUOUS] * 3


def test_scans_that_came_late_make_nothing_surer() -> None:
    world, poses = one_place(), ahead(8)
    localizer = sequence(world)
    for i in (0, 3, 1, 2, 5, 4, 7, 6):
        at = np.array([0.5 * i, 0.0, 0.0])
        found = localizer.localize(seen(world, poses[i], range(5), stamp_ns=i), odometry(at, 0.5 * i))
        assert np.linalg.eigvalsh(localizer._local_map.covariance).min() > 0
        assert found.pose == pytest.approx(poses[i], abs=0.01)
