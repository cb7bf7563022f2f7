"""Logs to a map: one landmark per thing, confirmed and measured, with the path that was driven."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping import landmark_slam
from mcap_landmarks.mapping.built_map import BuiltMap
from mcap_landmarks.mapping.common_frame import align
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.landmark_slam import solve_jointly
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.maps.model import LandmarkMap, MapSource

from tests.mapping.drives import Drive, as_observed, drive, landmarks_beside

CONFIG = BuildMapConfig()
RADIUS_M, COUNT = 6.0, 12
CLASSES = tuple("abcabcddbcac")
WORLD = landmarks_beside(RADIUS_M, COUNT, 1)


def loop(seed: int, laps: float = 0.8, start_rad: float = 0.0) -> Drive:
    return drive(WORLD, RADIUS_M, seed, laps=laps, start_rad=start_rad, step_m=0.5)


def seen_in(given: Drive) -> set[int]:
    return set(given.log.landmark.tolist())


def worst_m(landmark_map: LandmarkMap, numbers: list[int]) -> float:
    """How far the landmark that is off most is from its place; the map's landmarks are these of the world."""
    assert landmark_map.classes == tuple(CLASSES[n] for n in numbers)
    onto = align(landmark_map.positions_xy, WORLD[numbers])
    return float(np.linalg.norm(se2.transform_points(onto, landmark_map.positions_xy) - WORLD[numbers], axis=1).max())


@pytest.fixture(scope="module")
def log() -> LogObservations:
    observed = as_observed(loop(1), CLASSES, radius_m=0.0)
    return replace(observed, radii_m=np.where(np.arange(len(observed.bundle)) % 3 == 0, 0.3, 0.0))


@pytest.fixture(scope="module")
def built(log: LogObservations) -> BuiltMap:
    return solve_jointly([log], None, CONFIG)


def order_of_appearance(given: Drive) -> list[int]:
    return list(dict.fromkeys(given.log.landmark.tolist()))


def test_a_log_becomes_a_map_of_confirmed_landmarks(built: BuiltMap) -> None:
    landmarks, numbers = built.landmark_map, order_of_appearance(loop(1))
    assert landmarks.ids == tuple(f"l{i + 1}" for i in range(len(numbers)))
    assert worst_m(landmarks, numbers) < 0.1
    assert not landmarks.tentative.any()
    assert landmarks.frame == "map"
    seen = np.bincount(loop(1).log.landmark)[numbers]
    assert (landmarks.sightings <= seen).all()
    assert landmarks.sightings.sum() > 0.95 * seen.sum()
    np.testing.assert_allclose(landmarks.covariances, landmarks.covariances.swapaxes(1, 2))
    assert 1e-6 < np.linalg.eigvalsh(landmarks.covariances).max() < 0.1


def test_radii_are_means_of_those_that_were_measured(built: BuiltMap) -> None:
    np.testing.assert_allclose(built.landmark_map.radii_m, 0.3)


def test_the_path_and_how_the_solver_ended_come_with_it(built: BuiltMap, log: LogObservations) -> None:
    path = built.trajectories[0]
    np.testing.assert_array_equal(path.stamps_ns, log.stamps_ns)
    np.testing.assert_array_equal(path.log_times_ns, log.log_times_ns)
    truth = se2.between(loop(1).poses[0], loop(1).poses)
    assert np.linalg.norm(path.map_from_base[:, :2] - truth[:, :2], axis=1).max() < 0.15
    assert built.termination is not None
    assert built.termination.converged


def test_the_source_tells_bundles_and_those_that_took_part(built: BuiltMap, log: LogObservations) -> None:
    source = built.landmark_map.sources[0]
    assert (source.kind, source.fingerprint, source.bundles) == ("recording", "made up", log.bundles)
    assert source.used == len(np.unique(log.bundle))


def test_groups_are_of_confirmed_landmarks(built: BuiltMap) -> None:
    assert len(built.landmark_map.groups) > 3
    assert all(len(group.landmark_ids) == 3 for group in built.landmark_map.groups)


def test_a_wrong_observation_is_no_part_of_radius_or_count() -> None:
    """Five sigmas too far or too near: within the gates, which are wide, but not where the solution has it."""
    short = as_observed(loop(1, laps=0.3), CLASSES, radius_m=0.3)
    wrong = np.flatnonzero(short.bundle == 9)
    points, radii = short.points_xy.copy(), short.radii_m.copy()
    ranges = np.linalg.norm(points[wrong], axis=1)
    points[wrong] *= (1 + 4.8 * 0.03 * np.array([1, -1, 1, -1]) / ranges)[:, None]
    radii[wrong] = 9.0
    built = solve_jointly([replace(short, points_xy=points, radii_m=radii)], None, CONFIG)
    assert len(built.landmark_map) == len(seen_in(loop(1, laps=0.3)))
    np.testing.assert_allclose(built.landmark_map.radii_m, 0.3)
    assert built.landmark_map.sources[0].used == len(np.unique(short.bundle)) - 1


def test_two_logs_make_one_map(log: LogObservations) -> None:
    other = loop(2, laps=0.7, start_rad=2.0)
    together = solve_jointly([log, as_observed(other, CLASSES, "second")], None, CONFIG)
    first = order_of_appearance(loop(1))
    numbers = [*first, *(n for n in order_of_appearance(other) if n not in first)]
    landmarks = together.landmark_map
    assert set(numbers) == set(range(COUNT))
    assert sorted(landmarks.classes) == sorted(CLASSES)
    assert landmarks.classes[: len(first)] == tuple(CLASSES[n] for n in first)
    assert [source.fingerprint for source in landmarks.sources] == ["made up", "second"]
    assert len(together.trajectories) == 2


@pytest.fixture(scope="module")
def prior(built: BuiltMap) -> LandmarkMap:
    """The map of the first log, as if someone had surveyed it and named its landmarks."""
    kept = built.landmark_map
    names = tuple(f"tree {i}" for i in range(len(kept)))
    tentative = np.arange(len(kept)) == 0
    radii = np.where(np.arange(len(kept)) == 1, 0.7, 0.0)
    return replace(
        kept,
        ids=names,
        groups=(),
        frame="campus",
        tentative=tentative,
        radii_m=radii,
        sightings=np.full(len(kept), 100),
        sources=(MapSource("import", "surveyed"),),
    )


def test_a_prior_keeps_its_names_and_frame_and_gains_what_the_log_saw(prior: LandmarkMap) -> None:
    other = loop(2, laps=0.7, start_rad=2.0)
    extended = solve_jointly([as_observed(other, CLASSES, "second", radius_m=0.0)], prior, CONFIG).landmark_map
    count = len(prior)
    assert extended.ids[:count] == prior.ids
    assert extended.ids[count:] == tuple(f"l{i + 1}" for i in range(count, COUNT))
    assert extended.frame == "campus"
    assert [source.fingerprint for source in extended.sources] == ["surveyed", "second"]
    assert np.linalg.norm(extended.positions_xy[:count] - prior.positions_xy, axis=1).max() < 0.1
    assert extended.sightings[:count].min() >= 100
    assert extended.sightings[:count].sum() > prior.sightings.sum() + 50
    assert extended.radii_m[1] == pytest.approx(0.7)
    assert not extended.tentative.any()


def test_what_a_prior_confirmed_stays_confirmed_though_it_was_not_seen_again(prior: LandmarkMap) -> None:
    once = replace(prior, sightings=np.ones(len(prior), dtype=np.int64))
    short = loop(2, laps=0.3)
    extended = solve_jointly([as_observed(short, CLASSES, "second")], once, CONFIG).landmark_map
    unseen = [i for i, n in enumerate(order_of_appearance(loop(1))) if n not in seen_in(short)]
    assert len(unseen) > 2
    assert extended.sightings[unseen].tolist() == [1] * len(unseen)
    assert not extended.tentative[[i for i in unseen if i]].any()


def test_a_prior_without_covariances_counts_as_known_to_the_sensors_range_sigma(prior: LandmarkMap) -> None:
    plain = replace(prior, covariances=np.zeros_like(prior.covariances))
    observed = as_observed(loop(2, laps=0.3), CLASSES, "second")
    sharp, vague = (
        solve_jointly([observed], plain, replace(CONFIG, range_sigma_m=sigma)).landmark_map for sigma in (0.001, 0.2)
    )
    assert np.abs(sharp.positions_xy[: len(prior)] - prior.positions_xy).max() < 0.001
    assert np.abs(vague.positions_xy[: len(prior)] - prior.positions_xy).max() > 0.005


def test_a_log_that_saw_nothing_is_named(log: LogObservations) -> None:
    short = as_observed(loop(1, laps=0.1), CLASSES)
    nothing = replace(
        short,
        bundle=short.bundle[:0],
        classes=(),
        points_xy=short.points_xy[:0],
        covariances=short.covariances[:0],
        radii_m=short.radii_m[:0],
    )
    with pytest.raises(MapError, match=r"^log 2 holds no object in any bundle with odometry.*; log 3 holds no"):
        solve_jointly([log, nothing, nothing], None, CONFIG)


def test_what_was_seen_too_seldom_is_tentative() -> None:
    short = as_observed(loop(1, laps=0.2), CLASSES)
    everything = solve_jointly([short], None, replace(CONFIG, min_sightings=10_000)).landmark_map
    assert everything.tentative.all()
    assert everything.groups == ()


def test_covariances_are_the_solutions_made_symmetric_and_kept_from_zero() -> None:
    uneven = np.array([[[0.04, 0.01], [0.03, 0.09]], [[0.0, 0.0], [0.0, 0.0]]])
    expected = [[[0.04 + 1e-10, 0.02], [0.02, 0.09 + 1e-10]], [[1e-10, 0.0], [0.0, 1e-10]]]
    np.testing.assert_allclose(landmark_slam._definite(uneven), expected, rtol=1e-12)
