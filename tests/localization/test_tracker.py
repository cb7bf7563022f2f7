"""Tracking through the map: what is news, what errs alike, slip survived, and the place noticed to be lost."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry.se2 import Array, compose, inverse, transform_points
from mcap_landmarks.localization.acceptance import PairDensity
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.match import Fix
from mcap_landmarks.localization.tracker import Tracker
from mcap_landmarks.localization.verification import UNMATCHED
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import SIGMA_M, elsewhere, landmark_map, matcher, one_place, seen

WORLD = one_place()
MATCHER = matcher(WORLD)
POSE = np.array([-4.0, 1.0, 0.1])
SURE = np.diag([0.01**2, 0.01**2, 0.002**2])
ALL = range(5)


def tracker(covariance: Array = SURE, expected_accidental: float = 1e-9, rows: range = ALL) -> Tracker:
    """The robot at `POSE`, found by some of the place's landmarks."""
    fix = Fix(POSE, covariance, np.array(rows), expected_accidental, 1.0, 7)
    return Tracker(MATCHER, fix, transform_points(inverse(POSE), WORLD.positions_xy[list(rows)]), 30.0)


def update(track: Tracker, scene: SceneObjects) -> Fix:
    return track.update(MATCHER.objects(scene))


def drive(track: Tracker, step: Array, way_m: float) -> None:
    motion = Motions(step[None], np.array([way_m]), np.array([abs(step[2])]))
    track.predict(step, motion_covariance(motion, OdometryNoise())[0], way_m)


def with_stray(scene: SceneObjects, place: Array) -> SceneObjects:
    return SceneObjects(
        scene.stamp_ns,
        scene.frame_id,
        (*scene.ids, "stray"),
        (*scene.hypotheses, (("bench", 1.0),)),
        np.concatenate([scene.positions_xy, place[None]]),
        np.concatenate([scene.covariances, scene.covariances[:1]]),
        np.zeros(len(scene) + 1),
    )


UNKNOWN = replace(
    seen(WORLD, POSE, range(3)), positions_xy=np.array([[3.0, 8.0], [5.0, -7.0], [1.0, -9.0]])
)  # what no place near the tracked one looks like


def test_what_is_seen_again_is_no_news_and_what_is_new_is() -> None:
    track = tracker(rows=range(3))
    again = [update(track, seen(WORLD, POSE, range(3))).expected_accidental for _ in range(10)]
    assert again == pytest.approx([1e-9] * 10, rel=1e-9)
    fourth = update(track, seen(WORLD, POSE, range(4))).expected_accidental
    assert 1e-14 < fourth < 1e-11
    assert update(track, seen(WORLD, POSE, range(4))).expected_accidental == pytest.approx(fourth, rel=1e-9)


def looks_in(count: int) -> float:
    """How many independent looks so many from one place are worth: the n-th has n times the sensor's variance."""
    of_map = LocalizeConfig().map_sigma_m ** 2
    return sum((SIGMA_M**2 + of_map) / (n * SIGMA_M**2 + of_map) for n in range(1, count + 1))


def test_errors_that_are_the_same_in_every_look_do_not_average_out() -> None:
    """Standing still, forty looks with one error say as much as seven: a fortieth of the variance would be a lie."""
    track = tracker(np.diag([0.3**2, 0.3**2, 0.1**2]))
    off = SIGMA_M * np.random.default_rng(1).normal(size=(5, 2))
    covariances = [update(track, seen(WORLD, POSE, ALL, off)).covariance for _ in range(40)]
    ratio = np.diag(covariances[-1]) / np.diag(covariances[0])
    np.testing.assert_allclose(ratio, 1 / looks_in(40), rtol=0.05)


def test_looks_from_elsewhere_say_more() -> None:
    variances = []
    for way_m in (0.0, 6.0):
        track = tracker(np.diag([0.3**2, 0.3**2, 0.1**2]))
        for _ in range(10):
            track.predict(np.zeros(3), np.zeros((3, 3)), way_m)  # there and back, so that the pose stays
            fix = update(track, seen(WORLD, POSE, ALL))
        variances.append(np.diag(fix.covariance))
    np.testing.assert_allclose(variances[1] / variances[0], looks_in(10) / 10, rtol=0.05)


@pytest.mark.parametrize("short_m", [0.3, 0.8])
def test_wheels_may_slip(short_m: float) -> None:
    """The wheels told a metre, of which the robot came less: six and sixteen sigmas of odometry."""
    track = tracker()
    drive(track, np.array([1.0, 0.0, 0.0]), 1.0)
    there = compose(POSE, np.array([1.0 - short_m, 0.0, 0.0]))
    fix = update(track, seen(WORLD, there, ALL))
    np.testing.assert_array_equal(fix.landmarks, ALL)
    np.testing.assert_allclose(fix.pose, there, atol=0.01)
    assert not track.lost


def test_a_slip_is_no_cheaper_than_it_is() -> None:
    """Where odometry was right, its sigmas are taken as they are: a slip would leave the pose wider."""
    track = tracker()
    drive(track, np.array([1.0, 0.0, 0.0]), 1.0)
    before = track._hypotheses[0].covariance
    fix = update(track, seen(WORLD, compose(POSE, np.array([1.0, 0.0, 0.0])), range(1)))
    assert np.linalg.det(fix.covariance) < np.linalg.det(before)
    np.testing.assert_array_equal(fix.landmarks, [0])


def test_going_astray_is_noticed() -> None:
    """Objects that keep matching nothing: the same three, so no news, but nine times none is too much."""
    track = tracker()
    found = [(update(track, UNKNOWN).landmarks.tolist(), track.lost) for _ in range(3)]
    assert found == [([UNMATCHED] * 3, False), ([UNMATCHED] * 3, False), ([UNMATCHED] * 3, True)]


def test_strays_among_landmarks_do_not_lead_astray() -> None:
    track = tracker(expected_accidental=1e-6, rows=range(3))
    rng = np.random.default_rng(3)
    for i in range(40):
        if i:
            track.predict(np.array([0.1, 0.0, 0.0]), np.diag([1e-5, 1e-5, 1e-6]), 0.5)  # in curves
        scene = seen(WORLD, compose(POSE, np.array([0.1 * i, 0.0, 0.0])), range(3))
        fix = update(track, with_stray(scene, rng.uniform(-6, 6, 2)))
        assert not track.lost
    np.testing.assert_array_equal(fix.landmarks, [0, 1, 2, UNMATCHED])
    # Of twenty metres of strays only those of the last two count: four, each a tenth likely.
    assert fix.expected_accidental == pytest.approx(1e-6 * 10**4, rel=0.1)


@pytest.mark.parametrize(("sigma_rad", "lost"), [(0.49, False), (0.51, True)])
def test_a_lost_heading_is_noticed(sigma_rad: float, lost: bool) -> None:
    track = tracker()
    track.predict(np.zeros(3), np.diag([1e-8, 1e-8, sigma_rad**2]), 0.0)
    assert track.lost is lost


@pytest.mark.parametrize(("odds", "lost"), [(0.9, False), (1.1, True)])
def test_a_place_that_is_likelier_wrong_is_lost(odds: float, lost: bool) -> None:
    assert tracker(expected_accidental=odds).lost is lost


@pytest.mark.parametrize(("sigma_m", "lost"), [(1.2, False), (1.3, True)])
def test_a_position_among_more_than_one_landmark_by_chance_is_lost(sigma_m: float, lost: bool) -> None:
    """In a map of a landmark on each ten square metres: 2 pi 1.26^2 of them."""
    crowded = matcher(WORLD)
    crowded.density = PairDensity(np.log([1.0, 10.0, 100.0]), np.log([9.0, 9.0, 0.1]))
    fix = Fix(POSE, SURE, np.array(ALL), 1e-9, 1.0, 7)
    track = Tracker(crowded, fix, transform_points(inverse(POSE), WORLD.positions_xy[:5]), 30.0)
    track.predict(np.zeros(3), np.diag([sigma_m**2, sigma_m**2, 0.0]), 0.0)
    assert track.lost is lost


TWINS = landmark_map(
    np.concatenate([[[0.0, 0.0], [1.0, 0.0], [4.0, 3.0]], elsewhere()[0]]),
    ("bench", "bench", "hydrant", *elsewhere()[1]),
)
SOUTH = np.array([0.0, -5.0, np.pi / 2])


@pytest.mark.parametrize("which", [0, 1])
def test_two_ways_to_read_a_bundle_live_until_a_later_one_decides(which: int) -> None:
    """Of two benches one is seen, from half-way between where each of them would have it."""
    twins = matcher(TWINS)
    there = SOUTH + np.array([float(which), 0.0, 0.0])
    sideways = np.diag([0.02**2, 0.6**2, 0.01**2])
    fix = Fix(SOUTH + np.array([0.5, 0.0, 0.0]), sideways, np.zeros(0, dtype=np.int64), 1e-6, 1.0, 3)
    track = Tracker(twins, fix, np.zeros((0, 2)), 30.0)
    one = track.update(twins.objects(seen(TWINS, there, [which])))
    assert one.expected_accidental == pytest.approx(1.0, abs=0.01)
    assert one.expected_accidental > LocalizeConfig().accidental
    both = track.update(twins.objects(seen(TWINS, there, [which, 2])))
    np.testing.assert_array_equal(both.landmarks, [which, 2])
    np.testing.assert_allclose(both.pose, there, atol=0.01)
    assert both.expected_accidental < 1e-3


def test_a_bundle_without_objects_changes_nothing() -> None:
    track = tracker()
    fix = update(track, seen(WORLD, POSE, []))
    np.testing.assert_array_equal(fix.pose, POSE)
    np.testing.assert_array_equal(fix.covariance, SURE)
    assert (len(fix.landmarks), fix.dof, fix.chi2) == (0, 0, 0.0)
    assert fix.expected_accidental == pytest.approx(1e-9, rel=1e-9)


def test_odometry_carries_pose_and_covariance() -> None:
    """A heading that is off by a bit moves the position aside: along the way for a quarter turn behind it."""
    track = tracker(np.diag([0.01**2, 0.02**2, 0.1**2]))
    track.predict(np.array([2.0, 0.0, np.pi / 2]), np.zeros((3, 3)), 2.0)
    best = track._hypotheses[0]
    np.testing.assert_allclose(best.pose, compose(POSE, np.array([2.0, 0.0, np.pi / 2])))
    expected = [[0.02**2 + (2 * 0.1) ** 2, 0, 2 * 0.1**2], [0, 0.01**2, 0], [2 * 0.1**2, 0, 0.1**2]]
    np.testing.assert_allclose(best.covariance, expected, atol=1e-12)
    np.testing.assert_array_equal(best.by_motion, np.zeros((3, 3)))


def test_a_fix_tells_how_well_the_bundle_fits() -> None:
    off = np.zeros((5, 2))
    off[0] = [0.0, 0.06]
    exact, bad = (update(tracker(SURE / 100), seen(WORLD, POSE, ALL, error)) for error in (0.0, off))
    assert exact.chi2 == pytest.approx(0.0, abs=1e-9)
    assert (exact.dof, bad.dof) == (10, 10)
    variance = SIGMA_M**2 + LocalizeConfig().map_sigma_m ** 2
    assert bad.chi2 == pytest.approx(0.06**2 / variance, rel=0.01)


@pytest.mark.parametrize(("bundles", "lost"), [(4, False), (5, True)])
def test_eight_more_objects_that_match_nothing_are_not_yet_too_many(bundles: int, lost: bool) -> None:
    track = tracker()
    for _ in range(bundles):
        update(track, replace(seen(WORLD, POSE, range(2)), positions_xy=UNKNOWN.positions_xy[:2]))
    assert track.lost is lost


def test_what_matches_makes_up_for_what_does_not() -> None:
    track = tracker()
    for _ in range(2):
        update(track, UNKNOWN)
        update(track, seen(WORLD, POSE, ALL))
    assert track._astray == 0
    update(track, with_stray(seen(WORLD, POSE, range(1)), np.array([3.0, 8.0])))
    assert track._astray == 0


@pytest.mark.parametrize(("sigmas", "observations"), [(2.9, 3), (3.1, 1)])
def test_an_unmapped_object_is_known_again_within_three_sigmas(sigmas: float, observations: int) -> None:
    track = tracker(SURE / 1e4, rows=range(3))
    place = np.array([3.0, 8.0])
    for _ in range(2):
        update(track, with_stray(seen(WORLD, POSE, range(3)), place))
    beside = place + np.array([sigmas * np.sqrt(2) * SIGMA_M, 0.0])
    update(track, with_stray(seen(WORLD, POSE, range(3)), beside))
    assert track._hypotheses[0].evidence.observations[-1] == observations


def test_new_landmarks_speak_by_how_well_they_fit_against_how_many_are_expected_there() -> None:
    """The gain of a fourth landmark, from its own density, class and probability of being in the map."""
    track = tracker(SURE / 1e4, rows=range(3))
    before = track._hypotheses[0].evidence.gain.sum()
    update(track, seen(WORLD, POSE, range(4)))
    evidence = track._hypotheses[0].evidence
    variance = SIGMA_M**2 + LocalizeConfig().map_sigma_m ** 2
    apart = np.linalg.norm(WORLD.positions_xy[3] - WORLD.positions_xy[:3], axis=1)
    expected = MATCHER.density.at(apart).max()
    number = MATCHER.index.class_of[3]
    ratio = MATCHER.classes.log_ratios(MATCHER.classes.probabilities([((WORLD.classes[3], 1.0),)]))[0, number]
    gain = -np.log(2 * np.pi * variance) + np.log(1 - LocalizeConfig().spurious) - expected + ratio
    assert evidence.gain.sum() - before == pytest.approx(gain, rel=1e-3)
