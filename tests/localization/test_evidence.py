"""What a tracked robot has observed counts once, for a while, and errs alike from nearby."""

import numpy as np
import pytest
from mcap_landmarks.localization.evidence import Evidence
from mcap_landmarks.localization.verification import UNMATCHED
from numpy.typing import NDArray

LENGTH_M = 30.0
PLACES = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 3.0]])


def rows(*numbers: int) -> NDArray[np.int64]:
    return np.array(numbers, dtype=np.int64)


def begun() -> Evidence:
    """Two landmarks, 4 and 7, and an object beside them, at a place accepted with one accident in e^8 expected."""
    return Evidence.of(LENGTH_M, PLACES, rows(4, 7, UNMATCHED), np.exp(-8.0))


def observed(before: Evidence, landmarks: NDArray[np.int64], places: NDArray[np.float64], gain: float) -> Evidence:
    again = before.associate(landmarks, places, np.full(len(landmarks), 0.5))
    return before.updated(again, landmarks, places, np.full(len(landmarks), gain))


def test_the_landmarks_of_an_accepted_place_share_what_spoke_for_it() -> None:
    evidence = begun()
    np.testing.assert_allclose(evidence.gain, [4.0, 4.0, 0.0], rtol=1e-12)
    assert evidence.odds_against == pytest.approx(np.exp(-8.0), rel=1e-12)


def test_what_is_observed_again_is_no_news() -> None:
    evidence = begun()
    for _ in range(5):
        evidence = observed(evidence, rows(7, 4), PLACES[[1, 0]], 3.0)
    assert len(evidence.landmarks) == 3
    assert evidence.odds_against == pytest.approx(np.exp(-8.0), rel=1e-12)
    np.testing.assert_array_equal(evidence.observations, [7, 7, 2])


def test_what_is_new_speaks_for_the_place_or_against_it() -> None:
    evidence = observed(begun(), rows(9, UNMATCHED), np.array([[9.0, 9.0], [-9.0, 9.0]]), -1.5)
    np.testing.assert_array_equal(evidence.landmarks, [4, 7, UNMATCHED, 9, UNMATCHED])
    np.testing.assert_array_equal(evidence.observations, [2, 2, 2, 1, 1])
    assert evidence.odds_against == pytest.approx(np.exp(-5.0), rel=1e-12)


def test_unmapped_objects_are_known_by_their_place() -> None:
    places = np.array([[3.0, 3.4], [3.0, 3.6], [1.0, 0.0], [2.0, 0.0]])
    again = begun().associate(rows(UNMATCHED, UNMATCHED, 4, 8), places, np.full(4, 0.5))
    np.testing.assert_array_equal(again, [2, -1, 0, -1])
    nothing = Evidence.of(LENGTH_M, np.zeros((0, 2)), rows(), 1.0)
    np.testing.assert_array_equal(nothing.associate(rows(4), PLACES[:1], np.ones(1)), [-1])


def test_strays_are_forgotten_after_two_metres() -> None:
    """What matches nothing and is not observed again was no object: it must not count against the place for long."""
    evidence = observed(begun(), rows(UNMATCHED), np.array([[-9.0, 9.0]]), -2.3)
    assert len(evidence.after(1.9).landmarks) == 4
    gone = evidence.after(2.1)
    np.testing.assert_array_equal(gone.landmarks, [4, 7, UNMATCHED])
    assert gone.odds_against == pytest.approx(np.exp(-8.0), rel=1e-12)


def test_an_unmapped_object_that_was_observed_again_stays() -> None:
    evidence = observed(begun(), rows(UNMATCHED), np.array([[-9.0, 9.0]]), -2.3)
    evidence = observed(evidence.after(1.9), rows(UNMATCHED), np.array([[-9.0, 9.3]]), -2.3)
    kept = evidence.after(1.9).after(1.9)
    assert kept.odds_against == pytest.approx(np.exp(-5.7), rel=1e-12)


def test_everything_is_forgotten_after_the_length() -> None:
    assert len(begun().after(29.9).landmarks) == 3
    evidence = observed(begun().after(29.0), rows(4), PLACES[:1], 0.0).after(1.1)
    np.testing.assert_array_equal(evidence.landmarks, [4])
    np.testing.assert_allclose(evidence.unseen_m, [1.1])


def test_observations_from_nearby_err_alike_and_those_from_afar_do_not() -> None:
    """The n-th look at a landmark from one place says an n-th of what the first did; after some metres it is new."""
    evidence = begun()
    for count in (1.0, 2.0, 3.0):
        np.testing.assert_allclose(evidence.effective_of(rows(4)), [count])
        evidence = observed(evidence, rows(4), PLACES[:1], 0.0)
    np.testing.assert_allclose(evidence.after(2.0).effective_of(rows(4)), [4 / np.e])
    np.testing.assert_allclose(evidence.after(20.0).effective_of(rows(4, 7, 9, UNMATCHED)), [1, 1, 1, 1])


def test_odds_stay_within_what_a_number_holds() -> None:
    sure = Evidence.of(LENGTH_M, PLACES[:1], rows(4), 0.0)
    assert sure.gain[0] == pytest.approx(300 * np.log(10))
    assert 0 < observed(sure, rows(9), PLACES[1:2], 1e4).odds_against < 1e-300
    assert np.isfinite(observed(sure, rows(9), PLACES[1:2], -1e4).odds_against)
