"""Maps of several logs: whatever the order of the logs, and without those that do not fit."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.built_map import BuiltMap
from mcap_landmarks.mapping.common_frame import align
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.landmark_slam import solve_jointly
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.maps.model import LandmarkMap

from tests.mapping.drives import Array, Drive, as_observed, drive, landmarks_beside

CONFIG = BuildMapConfig()
RADIUS_M, COUNT = 6.0, 14
CLASSES = tuple("abcabcddbcacdb")
WORLD, ANOTHER = landmarks_beside(RADIUS_M, COUNT, 1), landmarks_beside(RADIUS_M, COUNT, 77)


def lap(seed: int, world: Array = WORLD) -> Drive:
    return drive(world, RADIUS_M, seed, laps=0.9, start_rad=seed, step_m=0.6)


def scaled(log: LogObservations, by: float) -> LogObservations:
    """Of a robot whose wheels are smaller than its odometry believes."""
    return replace(log, odom_from_base=log.odom_from_base * np.array([by, by, 1]), way_m=log.way_m * by)


def mirrored(log: LogObservations) -> LogObservations:
    """With odometry whose y axis points to the right."""
    return replace(log, odom_from_base=log.odom_from_base * np.array([1, -1, -1]))


@pytest.fixture(scope="module")
def good() -> list[LogObservations]:
    return [as_observed(lap(seed), CLASSES, f"log {seed}") for seed in range(3)]


@pytest.fixture(scope="module")
def built(good: list[LogObservations]) -> BuiltMap:
    return solve_jointly(good, None, CONFIG)


def same(one: LandmarkMap, other: LandmarkMap) -> bool:
    """Whether two maps are the same to the last bit, but for the order of their sources."""
    arrays = ("positions_xy", "covariances", "radii_m", "sightings", "tentative")
    return (one.ids, one.classes) == (other.ids, other.classes) and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in arrays
    )


def test_the_map_is_the_worlds(built: BuiltMap) -> None:
    numbers = [CLASSES.index(name) for name in built.landmark_map.classes]
    assert len(numbers) == COUNT
    paths = np.concatenate([path.map_from_base[:, :2] for path in built.trajectories if path is not None])
    truth = np.concatenate([lap(seed).poses[:, :2] for seed in range(3)])
    assert np.linalg.norm(se2.transform_points(align(paths, truth), paths) - truth, axis=1).max() < 0.2


def test_the_order_of_the_logs_does_not_matter(good: list[LogObservations], built: BuiltMap) -> None:
    for order in ([2, 0, 1], [1, 2, 0]):
        again = solve_jointly([good[i] for i in order], None, CONFIG)
        assert same(again.landmark_map, built.landmark_map)
        for i, path in zip(order, again.trajectories, strict=True):
            before = built.trajectories[i]
            assert path is not None
            assert before is not None
            np.testing.assert_array_equal(path.map_from_base, before.map_from_base)


def test_logs_that_do_not_fit_are_left_out_and_the_map_is_what_it_is_without(
    good: list[LogObservations], built: BuiltMap
) -> None:
    wrong = [
        scaled(as_observed(lap(9), CLASSES), 1.2),
        mirrored(as_observed(lap(9), CLASSES)),
        as_observed(lap(9, ANOTHER), CLASSES),
        as_observed(lap(9), tuple("efghij" * 3)),
    ]
    found = solve_jointly([*wrong, *good], None, CONFIG)
    assert list(found.excluded) == [0, 1, 2, 3]
    assert found.excluded[0].startswith("its odometry measures ways 1.1")
    assert found.excluded[1].startswith("its odometry measures turns -1.")
    assert found.excluded[2].startswith(("disagrees with the others: ", "cannot be laid on the rest of the map: "))
    assert found.excluded[3] == "cannot be laid on the rest of the map: too few landmarks in common"
    assert found.trajectories[:4] == [None] * 4
    assert same(found.landmark_map, built.landmark_map)
    assert [source.fingerprint for source in found.landmark_map.sources] == [f"log {seed}" for seed in range(3)]


def test_of_two_logs_that_do_not_fit_none_is_believed(good: list[LogObservations]) -> None:
    other = as_observed(lap(9), tuple("efghij" * 3))
    with pytest.raises(MapError, match=r"^log 2 cannot be laid on the rest of the map: too few landmarks in common; "):
        solve_jointly([good[0], other], None, CONFIG)


def test_on_a_prior_one_log_is_enough(good: list[LogObservations], built: BuiltMap) -> None:
    other = as_observed(lap(9), tuple("efghij" * 3))
    extended = solve_jointly([other, good[0]], built.landmark_map, CONFIG)
    assert list(extended.excluded) == [0]
    assert extended.landmark_map.ids == built.landmark_map.ids
    with pytest.raises(MapError, match=r"^log 1 cannot be laid on the rest of the map"):
        solve_jointly([other], built.landmark_map, CONFIG)
