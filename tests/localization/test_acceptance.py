"""What makes a match no accident: classes, density, and the number of false alarms."""

import numpy as np
import pytest
from mcap_landmarks.localization.acceptance import ClassEvidence, PairDensity, log_tail
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NAMES = ("bench", "person", "hydrant")
MISREAD = 0.03


def classes(*numbers: int) -> NDArray[np.int64]:
    return np.array(numbers, dtype=np.int64)


def test_classes_that_the_map_has_once_say_that_there_are_more() -> None:
    """Good and Turing: of six objects seen next, about as many are of a new class as classes were met once."""
    found = ClassEvidence.of(NAMES, classes(0, 0, 0, 1, 2), MISREAD)
    np.testing.assert_allclose(found.frequency, np.array([3, 1, 1]) / 5 * (1 - 2 / 6), rtol=1e-12)
    often = ClassEvidence.of(NAMES, classes(0, 0, 1, 1, 2, 2), MISREAD)
    np.testing.assert_allclose(often.frequency, [1 / 3] * 3, rtol=1e-12)


def test_a_rare_class_says_more_than_a_frequent_one() -> None:
    evidence = ClassEvidence.of(NAMES, classes(0, 0, 0, 0, 0, 0, 1, 1, 2, 2), MISREAD)
    options = [(("bench", 1.0),), (("person", 1.0),)]
    ratios = evidence.log_ratios(evidence.probabilities(options))
    of_bench, of_person = ratios[0, 0], ratios[1, 1]
    assert of_bench == pytest.approx(np.log(0.98 / (0.98 * 0.6 + 0.01 * 0.4)), rel=1e-9)
    assert of_person == pytest.approx(np.log(0.98 / (0.98 * 0.2 + 0.01 * 0.8)), rel=1e-9)
    assert ratios[0, 1] == pytest.approx(np.log(0.01 / (0.98 * 0.6 + 0.01 * 0.4)), rel=1e-9)


def test_unseen_classes_make_the_unknown_place_likelier() -> None:
    """What was seen as a known class may be of none that the map has, misread."""
    once = ClassEvidence.of(NAMES, classes(0, 1, 2), MISREAD)
    seen = once.probabilities([(("bench", 1.0),)])
    anywhere = 0.25 / 3 * (0.98 + 0.01 + 0.01) + 0.75 * MISREAD / 3
    assert once.log_ratios(seen)[0, 0] == pytest.approx(np.log(0.98 / anywhere), rel=1e-9)


def test_scores_are_shared_among_the_classes_of_the_map() -> None:
    evidence = ClassEvidence.of(NAMES, classes(0, 0, 1, 1, 2, 2), MISREAD)
    options = [
        (("bench", 0.6), ("cat", 0.2), ("person", 0.2)),
        (("cat", 0.9),),
        (("bench", -1.0), ("person", 2.0)),
        (),
    ]
    expected = 0.97 * np.array([[0.6, 0.2, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]]) + 0.01
    np.testing.assert_allclose(evidence.probabilities(options), expected, rtol=1e-12)


def test_a_lucky_fit_counts_like_an_average_one() -> None:
    dof = classes(7, 7, 7, 1, 1)
    lucky, average, bad, none, one = log_tail(np.array([0.0, 7.0, 14.0, 0.0, 1.0]), dof)
    assert lucky == average
    assert none == one
    assert bad == pytest.approx(average + 3.5 * np.log(2), rel=1e-12)
    # Half a degree of freedom: the volume of an interval of two sigmas, over the height of the Gaussian.
    assert one == pytest.approx(np.log(2 / np.sqrt(2 * np.pi)), rel=1e-12)
    assert log_tail(np.array([0.0]), classes(0)) == log_tail(np.array([0.0]), classes(1))


@pytest.fixture(scope="module")
def lattice() -> PairDensity:
    """One landmark on each square of 2 m, 40 by 40 of them."""
    positions = np.stack(np.meshgrid(np.arange(40), np.arange(40)), axis=-1).reshape(-1, 2) * 2.0
    return PairDensity.of(cKDTree(positions), positions)


def test_the_density_of_a_lattice(lattice: PairDensity) -> None:
    near = np.exp(lattice.at(np.array([10.0, 14.0])))
    np.testing.assert_allclose(near, 0.25 * (1 - 4 / np.pi * np.array([10.0, 14.0]) / 80), rtol=0.05)  # less at the rim
    assert lattice.at(np.array([0.5]))[0] == lattice.log_density[0]
    assert np.exp(lattice.log_density[-1]) < 0.001  # there the map ends


def test_each_object_is_expected_by_those_before_it(lattice: PairDensity) -> None:
    points = np.array([[[0.0, 0.0], [12.0, 0.0], [2.0, 0.0]]])
    first, far, near = lattice.chain(points)[0]
    assert near == lattice.at(np.array([2.0]))[0]
    assert far == max(lattice.at(np.array([10.0]))[0], lattice.at(np.array([12.0]))[0])
    assert first == min(near, far)
    alone = lattice.chain(points[:, :1])
    assert alone.shape == (1, 1)
    assert alone[0, 0] == lattice.log_density[-1]
