"""Maps from drives whose truth is known: accuracy, honesty, wrong sightings, several logs, known landmarks."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, dead_reckoning, motion_covariance
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.common_frame import align
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.confirmation import confirmed
from mcap_landmarks.mapping.graph_slam import KnownLandmarks, MapSolution, solve_map

from tests.estimation.worlds import Array
from tests.mapping.drives import Drive, drive, landmarks_beside, with_wrong_landmarks

RADIUS_M = 12.0
SEEDS = range(4)
CONFIG = BuildMapConfig()


def loop(
    seed: int, laps: float = 1.2, start_rad: float = 0.0, step_m: float = 0.25, sigma_range_m: float = 0.03
) -> Drive:
    return drive(
        landmarks_beside(RADIUS_M, 30, seed),
        RADIUS_M,
        seed,
        laps=laps,
        start_rad=start_rad,
        step_m=step_m,
        sigma_range_m=sigma_range_m,
    )


def errors(solution: MapSolution, truth: Array) -> tuple[Array, Array]:
    """Errors (L, 2) of the landmarks after alignment to the truth, and covariances turned alike."""
    onto = align(solution.landmarks_xy, truth[solution.number])
    miss = se2.transform_points(onto, solution.landmarks_xy) - truth[solution.number]
    turn = se2.rotation(onto[2])
    return miss, turn @ solution.covariance @ turn.T


def rms(miss: Array) -> float:
    return float(np.sqrt((miss**2).sum(axis=1).mean()))


def test_a_loop_maps_far_better_than_its_odometry_and_says_how_well() -> None:
    misses, squares, drifts = [], [], []
    for seed in SEEDS:
        given = loop(seed)
        solution = solve_map([given.log], CONFIG)
        miss, covariance = errors(solution, given.landmarks_xy)
        misses.append(rms(miss))
        squares.append(np.einsum("li,li->l", miss, np.linalg.solve(covariance, miss[..., None])[..., 0]).mean() / 2)
        reckoned = dead_reckoning(given.log.start, given.log.motions)
        world = se2.compose(given.poses[0], reckoned)
        drifts.append(rms(world[:, :2] - given.poses[:, :2]))
        np.testing.assert_array_equal(solution.trajectories[0][0], given.log.start)
    assert np.mean(misses) < 0.12
    assert np.mean(misses) < np.mean(drifts) / 5
    assert 0.2 < np.mean(squares) < 2


def test_wrong_sightings_hardly_matter_and_lose_their_weight() -> None:
    for seed in SEEDS:
        given = loop(seed)
        spoilt = with_wrong_landmarks(given, 0.1, seed)
        solution = solve_map([spoilt.log], CONFIG)
        assert rms(errors(solution, given.landmarks_xy)[0]) < 0.25
        wrong = spoilt.log.landmark != given.log.landmark
        assert np.median(solution.weights[0][wrong]) < 0.05
        assert np.median(solution.weights[0][~wrong]) > 0.3


def test_two_logs_from_different_starts_become_one_map() -> None:
    first, second = loop(1, laps=0.7), loop(1, laps=0.7, start_rad=np.pi)
    together = solve_map([first.log, second.log], CONFIG)
    assert together.number.tolist() == list(range(30))
    assert rms(errors(together, first.landmarks_xy)[0]) < 0.25
    np.testing.assert_array_equal(together.trajectories[0][0], first.log.start)
    meant = se2.between(first.poses[0], second.poses[0])
    assert np.hypot(*se2.between(meant, together.trajectories[1][0])[:2]) < 0.5


def test_a_known_map_gives_the_frame() -> None:
    given = loop(2)
    numbers = np.arange(8)
    known = KnownLandmarks(numbers, given.landmarks_xy[numbers], np.tile(1e-4 * np.eye(2), (8, 1, 1)))
    solution = solve_map([given.log], CONFIG, known)
    np.testing.assert_allclose(solution.landmarks_xy[:8], given.landmarks_xy[:8], atol=0.05)
    assert rms(solution.landmarks_xy - given.landmarks_xy) < 0.3
    assert (np.trace(solution.covariance[:8], axis1=1, axis2=2) < 2.1e-4).all()


def test_the_first_sighting_may_be_a_misreading() -> None:
    given = loop(3)
    first = np.flatnonzero(given.log.landmark == 20)[0]
    early = given.log.landmark.copy()
    early[:3] = 20
    assert first > 3
    solution = solve_map([replace(given.log, landmark=early)], CONFIG)
    assert rms(errors(solution, given.landmarks_xy)[0]) < 0.25


def test_noise_is_found_in_the_log() -> None:
    far_too_pessimistic = loop(0, laps=3, sigma_range_m=0.02)
    doubled = replace(far_too_pessimistic.log, covariance=4 * far_too_pessimistic.log.covariance)
    noise = solve_map([doubled], CONFIG).noise[0]
    np.testing.assert_allclose(noise.scale, 0.5, rtol=0.2)
    assert (noise.alike < 0.35).all()
    assert 0.01 < noise.odometry.position_per_metre_m < 0.04
    assert 0.005 < noise.odometry.heading_per_metre_rad < 0.03


def test_errors_that_repeat_from_one_place_are_not_counted_as_news() -> None:
    given = loop(0, step_m=0.05, sigma_range_m=1e-6)
    place = given.log.pose // 30
    offsets = np.random.default_rng(0).normal(0, 0.1, (place.max() + 1, 30))
    log = replace(
        given.log,
        range_m=given.log.range_m + offsets[place, given.log.landmark],
        covariance=np.tile(np.diag([0.1**2, 0.01**2]), (len(place), 1, 1)),
    )
    noise = solve_map([log], CONFIG).noise[0]
    assert noise.alike[0] > 0.7
    assert noise.alike[1] < 0.3


@pytest.mark.parametrize("logs", [0, 1])
def test_nothing_seen_is_an_error(logs: int) -> None:
    empty = loop(0).log.first(1)
    with pytest.raises(MapError, match="without a single observation of a landmark"):
        solve_map([replace(empty, pose=empty.pose[:0], landmark=empty.landmark[:0])] * logs, CONFIG)


def test_logs_without_a_common_landmark_are_an_error() -> None:
    one, other = loop(0), loop(0)
    with pytest.raises(MapError, match="log 2 shares 0 landmarks"):
        solve_map([one.log, replace(other.log, landmark=other.log.landmark + 100)], CONFIG)


def test_alignment_bears_wrong_points() -> None:
    rng = np.random.default_rng(0)
    points, move = rng.uniform(-10, 10, (40, 2)), np.array([3.0, -2.0, 2.5])
    onto = se2.transform_points(move, points)
    onto[:15] = rng.uniform(-10, 10, (15, 2))
    np.testing.assert_allclose(align(points, onto), move, atol=1e-9)
    np.testing.assert_allclose(align(points[20:22], onto[20:22]), move, atol=1e-9)


def test_landmarks_need_support_of_their_own() -> None:
    xy = np.array([[0.0, 0.0], [5.0, 0.0], [0.1, 0.05], [9.0, 9.0], [20.0, 0.0]])
    sightings = np.array([100, 80, 5, 5, 2])
    sure = confirmed(xy, np.tile(0.01 * np.eye(2), (5, 1, 1)), sightings, CONFIG)
    assert sure.tolist() == [True, True, False, True, False]


def test_odometry_errs_across_its_chord_as_a_random_walk_does() -> None:
    steps, turns = 100, np.random.default_rng(0).normal(0, 0.05 * 0.1, (4000, 100))
    still, ahead = np.zeros(steps), np.full(steps, 0.01)
    ends = [dead_reckoning(np.zeros(3), Motions(np.column_stack([ahead, still, t]), ahead, still))[-1] for t in turns]
    whole = Motions(np.array([[1.0, 0, 0]]), np.ones(1), np.zeros(1))
    expected = motion_covariance(whole, OdometryNoise(0.0, 0.05, 0.0))[0]
    np.testing.assert_allclose(np.cov(np.array(ends).T), expected, atol=1.5e-4)
