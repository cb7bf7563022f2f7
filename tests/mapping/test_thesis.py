"""The thesis's way to build a map, with odometry as truth."""

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.thesis import solve_as_in_the_thesis

POSES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
THREE = [(2.0, 1.0), (2.0, 0.0), (2.0, -1.0)]


def log_of(*bundles: str) -> LogObservations:
    """Bundles of up to four objects ahead, from left to right, named by a letter each."""
    points = [([*THREE, (9.0, 9.0)])[i] for names in bundles for i in range(len(names))]
    count, n = len(bundles), sum(map(len, bundles))
    return LogObservations(
        10 * np.arange(count),
        20 * np.arange(count),
        POSES[:count],
        np.zeros(count),
        np.zeros(count),
        np.repeat(np.arange(count), [len(names) for names in bundles]),
        tuple("".join(bundles)),
        np.array(points),
        np.tile(np.eye(2), (n, 1, 1)),
        np.zeros(n),
        count + 2,
        "a log",
    )


def test_the_latest_observation_of_a_triple_is_its_place() -> None:
    built = solve_as_in_the_thesis([log_of("abc", "abc")])
    landmarks = built.landmark_map
    assert landmarks.ids == ("g1.1", "g1.2", "g1.3")
    assert landmarks.classes == ("a", "b", "c")
    np.testing.assert_allclose(landmarks.positions_xy, [[0.0, 2.0], [1.0, 2.0], [2.0, 2.0]], atol=1e-12)
    assert landmarks.sightings.tolist() == [2, 2, 2]
    assert not landmarks.tentative.any()
    assert not landmarks.covariances.any()
    assert [group.landmark_ids for group in landmarks.groups] == [landmarks.ids]
    np.testing.assert_array_equal(landmarks.groups[0].map_from_base, POSES[1])


def test_other_orders_are_other_triples_and_other_counts_are_none() -> None:
    built = solve_as_in_the_thesis([log_of("abc", "abcd", "ab", "cba")])
    assert built.landmark_map.classes == ("a", "b", "c", "c", "b", "a")
    assert built.landmark_map.ids[3:] == ("g2.1", "g2.2", "g2.3")
    assert built.landmark_map.sightings.tolist() == [1] * 6
    source = built.landmark_map.sources[0]
    assert (source.kind, source.fingerprint, source.bundles, source.used) == ("recording", "a log", 6, 2)


def test_trajectories_are_the_odometry_and_nothing_was_solved() -> None:
    first, second = log_of("abc"), log_of("abc", "ab")
    built = solve_as_in_the_thesis([first, second])
    assert built.termination is None
    assert [source.used for source in built.landmark_map.sources] == [1, 1]
    assert len(built.trajectories) == 2
    np.testing.assert_array_equal(built.trajectories[1].map_from_base, POSES[:2])
    assert built.trajectories[1].stamps_ns.tolist() == [0, 10]
    assert built.trajectories[1].log_times_ns.tolist() == [0, 20]


def test_without_a_bundle_of_three_there_is_no_map() -> None:
    with pytest.raises(MapError, match="no bundle has exactly three objects"):
        solve_as_in_the_thesis([log_of("ab", "abcd")])
