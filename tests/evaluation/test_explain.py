"""Candidates are fitted again as they were, and the conditions name the one that failed."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.evaluation.explain import Limits, Situation, conditions_of, places_of
from mcap_landmarks.geometry.se2 import inverse, transform_points
from mcap_landmarks.messages.match import LandmarkMatch, Status

from tests.evaluation.scenes import scene

POSE = np.array([2.0, -1.0, 0.4])
PLACES_XY = np.array([[6.0, 1.0], [5.0, 4.0], [8.0, -2.0], [40.0, 40.0], [44.0, 40.0], [40.0, 43.0]])
NAMES = ["person", "bench", "suitcase"]
LANDMARKS = scene(NAMES * 2, PLACES_XY.tolist(), 0, ids=[f"l{i}" for i in range(6)])


def situation(match: LandmarkMatch, off_m: float = 0.0) -> Situation:
    seen = transform_points(inverse(POSE), PLACES_XY[:3])
    seen[0, 0] += off_m
    return Situation(0, scene(NAMES, seen.tolist(), 0, ids=["a", "b", "c"]), match, LANDMARKS)


def refused(status: Status, **what: object) -> LandmarkMatch:
    return LandmarkMatch(
        0, "base", status, candidate_ids=("l0+l2", "l3+l4+l5", "l9"), candidate_scores=np.array([0.6, 0.3, 0.1]), **what
    )


def failing(given: Situation) -> list[str]:
    return [one.name for one in conditions_of(given, places_of(given)) if not one.holds]


def test_a_match_is_fitted_with_its_own_pairs() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, ("b", "a", "c"), ("l1", "l0", "l2"), np.zeros(3))
    (place,) = places_of(situation(match))
    assert place.pose is not None
    np.testing.assert_allclose(place.pose, POSE, atol=1e-9)
    assert place.rows.tolist() == [1, 0, 2]
    assert place.dof == 3
    assert failing(situation(match)) == []


def test_candidates_find_the_objects_that_fit_them_best() -> None:
    given = situation(refused(Status.AMBIGUOUS, expected_accidental=0.4))
    first, second, third = places_of(given)
    assert first.rows.tolist() == [0, 2]
    assert first.pose is not None
    np.testing.assert_allclose(first.pose, POSE, atol=1e-9)
    assert first.chi2 < 1e-6
    assert second.chi2 > 100
    assert third.pose is None  # l9 is not in the map
    assert failing(given) == ["accidental"]
    (condition,) = [one for one in conditions_of(given, places_of(given)) if not one.holds]
    assert (condition.value, condition.limit) == (0.4, 0.002)


@pytest.mark.parametrize(
    ("status", "match", "expected"),
    [
        (Status.NO_MATCH, refused(Status.NO_MATCH), ["evidence"]),
        (
            Status.INCONSISTENT,
            LandmarkMatch(0, "base", Status.INCONSISTENT, ("a", "b", "c"), ("l0", "l1", "l2"), np.ones(3)),
            ["fit"],
        ),
    ],
)
def test_the_failed_condition_is_named(status: Status, match: LandmarkMatch, expected: list[str]) -> None:
    assert match.status is status
    assert failing(situation(match, off_m=1.5 if status is Status.INCONSISTENT else 0.0)) == expected


def test_few_objects_and_weak_geometry() -> None:
    weak = LandmarkMatch(0, "base", Status.WEAK_GEOMETRY, ("a", "b"), ("l0", "l1"), np.zeros(2))
    given = replace(situation(weak), limits=Limits.of({"max_sigma_m": 0.01, "tf": "auto"}))
    assert failing(given) == ["position"]
    lone = replace(situation(LandmarkMatch(0, "base", Status.TOO_FEW_OBJECTS)), scene=scene(["person"], [[1.0, 0]], 0))
    assert failing(lone) == ["objects"]
    assert conditions_of(Situation(0, None, None), ()) == ()


def test_of_a_position_from_ranges_alone_no_heading_is_asked() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, ("a", "b", "c"), ("l0", "l1", "l2"), np.zeros(3))
    narrow = replace(situation(match), limits=Limits(max_sigma_deg=1e-3))
    assert failing(narrow) == []
    assert failing(replace(narrow, covariance=np.diag([1e-4, 1e-4, 1e-2]))) == ["heading"]
