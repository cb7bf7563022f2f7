"""A match is shown as it was published; of a refused one the candidates are fitted again, to show where they lie."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.evaluation.explain import Situation, places_of
from mcap_landmarks.geometry.se2 import inverse, transform_points
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.messages.match import LandmarkMatch, Status

from tests.evaluation.scenes import scene

POSE = np.array([2.0, -1.0, 0.4])
PLACES_XY = np.array([[6.0, 1.0], [5.0, 4.0], [8.0, -2.0], [40.0, 40.0], [44.0, 40.0], [40.0, 43.0]])
NAMES = ["person", "bench", "suitcase"]
LANDMARKS = scene(NAMES * 2, PLACES_XY.tolist(), 0, ids=[f"l{i}" for i in range(6)])
ASIDE = POSE + np.array([0.1, 0.0, 0.0])
PAIRED = (("b", "a", "c"), ("l1", "l0", "l2"), np.array([0.01, 0.02, 0.03]))


def situation(match: LandmarkMatch) -> Situation:
    seen = transform_points(inverse(POSE), PLACES_XY[:3])
    return Situation(0, scene(NAMES, seen.tolist(), 0, ids=["a", "b", "c"]), match, LANDMARKS)


def test_what_was_published_is_shown_as_it_was() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, *PAIRED, chi2=4.5, dof=6)
    given = replace(situation(match), pose=ASIDE, covariance=np.diag([0.04, 0.01, 0.001]))
    (place,) = places_of(given)
    assert place.pose is ASIDE
    assert place.rows.tolist() == [1, 0, 2]
    assert place.residual_m is match.residual_m
    assert (place.chi2, place.dof, place.sigma_m) == (4.5, 6, pytest.approx(0.2))


def test_sigmas_are_those_of_object_and_landmark() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, *PAIRED)
    given = situation(match)
    assert given.scene is not None
    assert given.landmarks is not None
    spread = np.tile(np.diag([0.03**2, 0.03**2]), (3, 1, 1))
    given = replace(
        given,
        scene=replace(given.scene, covariances=spread),
        landmarks=replace(given.landmarks, covariances=np.tile(np.diag([0.04**2, 0.04**2]), (6, 1, 1))),
        pose=ASIDE,
        covariance=np.eye(3),
    )
    (place,) = places_of(given)
    assert place.sigmas == pytest.approx([2.0, 2.0, 2.0])


def test_sigmas_of_unknown_covariances_are_those_of_the_run() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, *PAIRED)
    given = replace(situation(match), pose=ASIDE, covariance=np.eye(3))
    tight, wide = (
        places_of(replace(given, config=LocalizeConfig(range_sigma_m=r, bearing_sigma_rad=b)))[0].sigmas
        for r, b in ((0.05, 0.01), (0.5, 0.1))
    )
    assert tight == pytest.approx(10 * wide)


def test_a_position_without_heading_stays_one() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, *PAIRED)
    (place,) = places_of(replace(situation(match), pose=np.array([2.0, -1.0, 0.0])))
    assert place.pose is not None
    np.testing.assert_array_equal(place.pose, [2.0, -1.0, np.nan])
    assert place.sigmas is None
    assert place.residual_m is match.residual_m


def test_a_refused_match_keeps_its_residuals_and_lies_where_its_pairs_say() -> None:
    match = LandmarkMatch(0, "base", Status.WEAK_GEOMETRY, *PAIRED, chi2=4.5, dof=6)
    (place,) = places_of(situation(match))
    assert place.pose is not None
    np.testing.assert_allclose(place.pose, POSE, atol=1e-9)
    assert place.residual_m is match.residual_m
    assert place.sigmas is None
    assert (place.chi2, place.dof) == (4.5, 6)
    assert np.isnan(place.sigma_m)


def test_candidates_find_the_objects_that_fit_them_best() -> None:
    names, scores = ("l0+l2", "l3+l4+l5", "l9", ""), np.array([0.6, 0.3, 0.1, 0.0])
    match = LandmarkMatch(0, "base", Status.AMBIGUOUS, candidate_ids=names, candidate_scores=scores)
    first, second, third = places_of(situation(match))
    assert first.rows.tolist() == [0, 2]
    assert first.pose is not None
    np.testing.assert_allclose(first.pose, POSE, atol=1e-9)
    assert first.chi2 < 1e-6
    assert first.sigmas == pytest.approx([0, 0], abs=1e-6)
    assert second.chi2 > 100
    assert third.pose is None  # l9 is not in the map


def test_what_is_not_in_the_log_is_not_shown() -> None:
    match = LandmarkMatch(0, "base", Status.LOCALIZED, ("a", "gone"), ("l0", "l1"), np.zeros(2))
    (place,) = places_of(situation(match))
    assert place.pose is None
    assert not len(place.rows)
    assert places_of(Situation(0, None, match)) == ()
    assert places_of(replace(situation(match), match=None)) == ()
