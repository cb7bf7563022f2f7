"""What a robot has observed lately: objects known again, wrong classes outvoted, strays told and forgotten."""

import numpy as np
import pytest
from mcap_landmarks.localization.acceptance import PairDensity
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.local_map import LocalMap
from numpy.typing import NDArray

CONFIG = LocalizeConfig()
SURE, LIKELY = np.array([0.98, 0.01, 0.01]), np.array([0.01, 0.98, 0.01])
SIGMA_M = 0.01
Seen = tuple[float, float, NDArray[np.float64]]


def empty(density: float = 1e-3) -> LocalMap:
    everywhere = PairDensity(np.log([1.0, 100.0]), np.log([density, density]))
    return LocalMap(everywhere, np.full(3, 1 / 3), 30.0, CONFIG)


def observe(local_map: LocalMap, *objects: Seen) -> NDArray[np.int64]:
    """One bundle of objects at places, with the likelihoods of their classes."""
    points = np.array([[x, y] for x, y, _ in objects]).reshape(-1, 2)
    spread = np.tile(SIGMA_M**2 * np.eye(2), (len(objects), 1, 1))
    return local_map.update(points, spread, np.array([seen for *_, seen in objects]).reshape(-1, 3))


def move(local_map: LocalMap, way_m: float, sigma_m: float = 0.001) -> None:
    """A way that ends where it began."""
    local_map.predict(np.zeros(3), np.diag([sigma_m**2, sigma_m**2, 1e-8]), way_m)


def test_what_is_not_observed_again_is_likelier_no_object() -> None:
    local_map = empty()
    first = observe(local_map, (5.0, 0.0, SURE), (0.0, 8.0, SURE))
    np.testing.assert_allclose(local_map.spurious_of(first), CONFIG.spurious)
    for x in (-6.0, -9.0, -12.0):
        again = observe(local_map, (5.0, 0.0, SURE), (x, 3.0, SURE))
        assert again[0] == first[0]
    stays, missed, fresh = local_map.spurious_of(np.array([first[0], first[1], again[1]]))
    assert stays == CONFIG.spurious
    # Ten objects' worth of the tenth that was believed, and three of five that were missed.
    share = (10 * CONFIG.spurious + 3) / (10 + 5)
    assert fresh == pytest.approx(share, rel=1e-12)
    assert missed == pytest.approx(share / (share + (1 - share) / 4), rel=1e-12)


def test_many_views_outvote_one_wrong_class() -> None:
    local_map = empty()
    for seen in (SURE, SURE, LIKELY, SURE, SURE):
        number = observe(local_map, (5.0, 0.0, seen))
    assert len(local_map) == 1
    row = int(np.searchsorted(local_map.numbers, number[0]))
    likely = local_map.probabilities[row]
    assert likely.argmax() == 0
    assert likely[0] > 0.95
    assert likely.min() >= CONFIG.misread / 3


def test_views_of_one_object_err_alike() -> None:
    """Four looks count as two, or one odd view, seen four times, would outweigh everything."""
    once, often = empty(), empty()
    observe(once, (5.0, 0.0, np.array([0.6, 0.3, 0.1])))
    for _ in range(4):
        observe(often, (5.0, 0.0, np.array([0.6, 0.3, 0.1])))
    odds = [local_map.probabilities[0, 0] / local_map.probabilities[0, 1] for local_map in (once, often)]
    assert odds == pytest.approx([2.0, 4.0], rel=1e-9)


def test_strays_are_forgotten_and_learned_from() -> None:
    local_map = empty()
    stray = observe(local_map, (5.0, 0.0, SURE), (0.0, 8.0, SURE))[1]
    for _ in range(3):
        assert stray in local_map.numbers
        move(local_map, 0.7)
        observe(local_map, (5.0, 0.0, SURE))
    move(local_map, 0.1)
    assert stray not in local_map.numbers
    assert len(local_map) == 1
    new = observe(local_map, (-9.0, 3.0, SURE))
    assert local_map.spurious_of(new) == pytest.approx((10 * CONFIG.spurious + 1) / (10 + 3), rel=1e-12)


@pytest.mark.parametrize(("bundles", "way_m"), [(2, 9.0), (9, 1.9)])
def test_what_few_bundles_missed_or_over_a_short_way_is_no_stray_yet(bundles: int, way_m: float) -> None:
    local_map = empty()
    number = observe(local_map, (0.0, 8.0, SURE))[0]
    for _ in range(bundles):
        observe(local_map)
    move(local_map, way_m)
    assert number in local_map.numbers


def test_everything_is_forgotten_after_the_length() -> None:
    local_map = empty()
    for _ in range(2):
        observe(local_map, (5.0, 0.0, SURE))
    move(local_map, 29.9)
    assert len(local_map) == 1
    move(local_map, 0.2)
    assert len(local_map) == 0


def test_what_more_than_one_landmark_would_fit_by_chance_is_forgotten() -> None:
    """In a map of a landmark on every ten square metres: 2 pi 1.26^2 of them."""
    for sigma_m, count in ((1.2, 1), (1.3, 0)):
        local_map = empty(density=0.1)
        observe(local_map, (5.0, 0.0, SURE))
        move(local_map, 0.1, sigma_m)
        assert len(local_map) == count


def test_half_of_the_error_is_in_every_look() -> None:
    local_map = empty()
    variances = []
    for _ in range(100):
        observe(local_map, (5.0, 0.0, SURE))
        variances.append(local_map.covariance[0, 0] / SIGMA_M**2)
    assert variances[0] == pytest.approx(1.0, rel=1e-9)
    assert variances[1] == pytest.approx(0.75, rel=1e-9)
    assert variances[-1] == pytest.approx(0.5 + 0.5 / 100, rel=1e-9)


def test_motion_moves_all_objects_and_makes_them_uncertain_together() -> None:
    local_map = empty()
    observe(local_map, (5.0, 0.0, SURE), (0.0, 4.0, SURE))
    spread = np.diag([0.01**2, 0.02**2, 0.001**2])
    local_map.predict(np.array([1.0, 0.0, np.pi / 2]), spread, 1.0)
    np.testing.assert_allclose(local_map.points_xy, [[0.0, -4.0], [4.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(local_map.age_m, [1.0, 1.0])
    joint = local_map.covariance
    # Forward errors of the step lie along the new -y axis, and are those of both objects.
    both = SIGMA_M**2 + np.array([0.02**2 + 16e-6, 0.01**2, 0.02**2 + 1e-6, 0.01**2 + 16e-6])
    np.testing.assert_allclose(np.diag(joint), both, rtol=1e-9)
    np.testing.assert_allclose(joint[0, 2], 0.02**2 + (4.0 * -1.0) * 1e-6, rtol=1e-9)
    np.testing.assert_allclose(joint[1, 3], 0.01**2, rtol=1e-9)


def test_an_object_known_again_tells_where_the_others_are() -> None:
    local_map = empty()
    observe(local_map, (5.0, 0.0, SURE), (0.0, 4.0, SURE))
    local_map.predict(np.zeros(3), np.diag([0.1**2, 0.1**2, 1e-8]), 1.0)
    observe(local_map, (5.1, 0.0, SURE))
    np.testing.assert_allclose(local_map.points_xy, [[5.1, 0.0], [0.1, 4.0]], atol=0.002)
    assert local_map.covariance[2, 2] < 0.02**2


@pytest.mark.parametrize(("seen", "same"), [(SURE, True), (LIKELY, False)])
def test_what_lies_beside_an_object_is_it_if_its_class_agrees(seen: NDArray[np.float64], same: bool) -> None:
    """Five sigmas off is still likelier than another object there, but for one of another class."""
    local_map = empty()
    for _ in range(2):
        first = observe(local_map, (5.0, 0.0, SURE))[0]
    other = observe(local_map, (5.068, 0.0, seen))[0]
    assert bool(other == first) is same


def test_two_objects_are_never_taken_for_one() -> None:
    local_map = empty()
    observe(local_map, (5.0, 0.0, SURE))
    numbers = observe(local_map, (5.0, 0.0, SURE), (5.01, 0.0, SURE))
    assert len(set(numbers.tolist())) == 2
    assert len(local_map) == 2


def test_no_more_objects_are_kept_than_are_matched_the_latest_and_most_observed() -> None:
    local_map = empty()
    for _ in range(2):
        observe(local_map, *((4.0 * i, 0.0, SURE) for i in range(20)))
    numbers = observe(local_map, *((4.0 * i, 50.0, SURE) for i in range(10)))
    assert len(local_map) == 24
    assert set(numbers.tolist()) <= set(local_map.numbers.tolist())


def test_what_was_observed_twice_is_an_object() -> None:
    local_map = empty()
    for y in (8.0, -8.0, 16.0):
        observe(local_map, (0.0, y, SURE))
    twice = observe(local_map, (0.0, 16.0, SURE))
    assert local_map.spurious_of(twice) == pytest.approx(CONFIG.spurious, rel=1e-12)
    assert local_map.spurious.max() > 2 * CONFIG.spurious


def test_one_object_counts_for_one_that_is_known() -> None:
    """Of two beside each other only the nearer is observed again."""
    local_map = empty()
    observe(local_map, (5.0, 0.0, SURE), (5.04, 0.0, SURE))
    assert observe(local_map, (5.0, 0.0, SURE)) == [0]
    np.testing.assert_array_equal(local_map.observations, [2, 1])


def test_the_classes_of_the_surest_object_are_averaged() -> None:
    local_map = empty()
    for seen in (SURE, SURE, LIKELY):
        observe(local_map, (5.0, 0.0, seen))
    np.testing.assert_allclose(local_map._called[0], (2 * SURE + LIKELY) / 3, rtol=1e-12)
