"""Class beliefs: how odds rise with detections, fall with misses, and keep what the settings say."""

import dataclasses
import math

import pytest
from mcap_landmarks.fusion.class_belief import ClassBelief
from mcap_landmarks.fusion.config import FuseConfig


def believing(*, alone: bool = False, **settings: float) -> ClassBelief:
    return ClassBelief(dataclasses.replace(FuseConfig(), **settings), alone=alone)


def odds(belief: ClassBelief, name: str) -> float:
    return math.exp(belief.log_odds[name])


def test_before_anything_is_seen_the_odds_are_the_prior() -> None:
    """Higher where no other scan can go on with the track."""
    assert believing(prior_odds=0.03).share("person") == pytest.approx(0.03 / 1.03)
    assert believing(prior_odds_alone=0.3, alone=True).share("person") == pytest.approx(0.3 / 1.3)
    assert believing().probabilities() == []
    assert believing().best() == ("", 0.0)


def test_a_detection_multiplies_odds_by_how_much_likelier_it_is() -> None:
    """Something would also be missed by the detector if it were of the class: to that share it tells nothing."""
    belief = believing(prior_odds=0.03, miss_odds=0.2)
    belief.hit("person", 50.0, 0.0, 1.0)
    assert odds(belief, "person") == pytest.approx(0.03 * (0.2 + 0.8 * 50))
    assert belief.best() == ("person", pytest.approx(1.206 / 2.206))
    belief.hit("person", 5.0, 0.0, 1.0)
    assert odds(belief, "person") == pytest.approx(1.206 * 4.2)


def test_one_detection_multiplies_odds_by_no_more_than_hit_odds() -> None:
    belief = believing(prior_odds=0.001, hit_odds=60.0, miss_odds=0.5)
    belief.hit("person", 1e9, 0.0, 1.0)
    assert odds(belief, "person") == pytest.approx(0.001 * (0.5 + 0.5 * 60))


def test_a_detection_of_one_class_speaks_a_little_for_every_other() -> None:
    """Since some detections have a wrong class; also for those that none has named yet."""
    belief = believing(prior_odds=0.03, confusion=0.05)
    belief.hit("person", 50.0, 0.0, 1.0)
    assert belief.share("suitcase") == pytest.approx(0.0603 / (1 + 1.206 + 0.0603))
    belief.hit("suitcase", 20.0, 0.0, 1.0)
    assert odds(belief, "suitcase") == pytest.approx(0.03 * 0.05 * 40.2 * 16.2)
    assert odds(belief, "person") == pytest.approx(1.206 * 0.05 * 16.2)
    assert math.exp(belief.other) == pytest.approx(0.03 * 0.05 * 40.2 * 0.05 * 16.2)
    belief.hit("suitcase", 20.0, 0.0, 1.0)
    shares = dict(belief.probabilities())
    assert belief.best() == ("suitcase", shares["suitcase"])
    assert shares["suitcase"] == pytest.approx(20 * shares["person"])
    assert shares["suitcase"] == pytest.approx(belief.share("suitcase"))


def test_a_miss_takes_odds_from_all_classes() -> None:
    belief = believing(prior_odds=0.03, miss_odds=0.2, max_odds=1e6)
    belief.hit("person", 50.0, 0.0, 1.0)
    belief.miss(1.0)
    assert odds(belief, "person") == pytest.approx(1.206 * 0.2)
    assert math.exp(belief.other) == pytest.approx(0.03 * 0.05 * 40.2 * 0.2)


def test_what_an_image_from_the_same_place_says_counts_less() -> None:
    """To a share, as so many independent images; that a class may be wrong counts whole."""
    belief = believing(prior_odds=0.03, miss_odds=0.2, max_odds=1e6)
    belief.hit("person", 50.0, 0.0, 0.5)
    assert odds(belief, "person") == pytest.approx(0.03 * 40.2**0.5)
    assert math.exp(belief.other) == pytest.approx(0.03 * 40.2**0.5 * 0.05)
    belief.miss(0.5)
    assert odds(belief, "person") == pytest.approx(0.03 * 40.2**0.5 * 0.2**0.5)


def test_odds_stay_below_the_most_so_that_mistakes_can_be_mended() -> None:
    belief = believing(prior_odds=0.03, max_odds=500.0)
    for _ in range(20):
        belief.hit("person", 200.0, 0.0, 1.0)
    assert odds(belief, "person") == pytest.approx(500.0)
    assert math.exp(belief.other) == pytest.approx(0.03 / 500.0)  # nor below what mends as fast
    belief.hit("suitcase", 100.0, 0.0, 1.0)
    assert odds(belief, "person") == pytest.approx(500.0)
    assert odds(belief, "suitcase") == pytest.approx(0.03 / 500.0 / 0.05)


def test_odds_stay_above_the_least() -> None:
    belief = believing(prior_odds=0.03, max_odds=500.0)
    belief.hit("person", 2.0, 0.0, 1.0)
    for _ in range(20):
        belief.miss(1.0)
    assert odds(belief, "person") == pytest.approx(0.03 / 500)
    assert math.exp(belief.other) == pytest.approx(0.03 / 500)


@pytest.mark.parametrize(
    ("asides", "missed"),
    [
        ([9.0], False),  # once is chance
        ([2.8, 2.8], False),  # 2.8 on the mean of two, whose sigma is the root of a half
        ([2.9, 2.9], True),
        ([-2.9, -2.9], True),  # to either side
        ([2.9, -2.9], False),  # in its middle, on the mean
        ([1.7] * 5, False),
        ([1.8] * 5, True),
        ([1.7] * 9, False),  # of later ones the last five or so count
        ([5.0, *[0.0] * 9, 0.0], False),
    ],
)
def test_detections_always_on_the_same_side_are_of_something_beside(asides: list[float], missed: bool) -> None:
    belief = believing(miss_odds=0.2)
    for aside in asides[:-1]:
        belief.hit("person", 50.0, aside, 1.0)
    before = belief.share("person")
    belief.hit("person", 50.0, asides[-1], 1.0)
    assert (belief.share("person") < before) == missed


def test_how_far_aside_is_an_average_of_late() -> None:
    belief = believing()
    for aside in (1.0, 2.0, 0.0, 0.5, 1.5, 3.0, -1.0):
        belief.hit("person", 50.0, aside, 1.0)
    mean = (1.0 + 2.0 + 0.0 + 0.5 + 1.5) / 5
    expected = mean + (3.0 - mean) / 5
    assert belief.aside == pytest.approx(expected + (-1.0 - expected) / 5)


def test_radii_are_averaged_per_class() -> None:
    belief = believing()
    belief.measure("vase", 0.2)
    assert belief.radii_m == {"vase": pytest.approx(0.2)}
    belief.measure("vase", 0.3)
    belief.measure("box", 0.9)
    assert belief.radii_m == {"vase": pytest.approx(0.7 * 0.2 + 0.3 * 0.3), "box": pytest.approx(0.9)}


def test_of_classes_as_probable_the_first_by_name_is_told_first() -> None:
    belief = believing()
    belief.log_odds = {"suitcase": 1.0, "person": 1.0, "car": 0.0}
    assert [name for name, _ in belief.probabilities()] == ["person", "suitcase", "car"]
