"""Fusion's settings: sizes by class, and what no object exceeds."""

import pytest
from mcap_landmarks.classes import ANY_SIZE, CLASSES, Size
from mcap_landmarks.fusion.config import FuseConfig
from pydantic import TypeAdapter, ValidationError

OWN = Size(top_m=(0.4, 0.6), width_m=(0.2, 0.4), radius_m=0.17)


def test_sizes_add_to_those_of_known_classes() -> None:
    config = FuseConfig(sizes={"urn": OWN, "person": OWN})
    assert [config.known_size(name) for name in ("urn", "person", "car", "vase")] == [
        OWN,
        OWN,
        CLASSES["car"].size,
        None,
    ]
    assert [config.size(name) for name in ("urn", "car", "vase")] == [OWN, CLASSES["car"].size, ANY_SIZE]


def test_no_object_is_larger_than_the_largest() -> None:
    """Of a class of its own, or as wide as the boxes of one without may be."""
    assert FuseConfig().largest_radius_m == CLASSES["bus"].size.radius_m == 5.8
    bus = Size(top_m=(2.5, 4.0), width_m=(2.5, 12.0), radius_m=6.0)
    assert FuseConfig(sizes={"bus": bus, "urn": OWN}).largest_radius_m == 6.0


def test_bearings_are_set_in_degrees() -> None:
    assert FuseConfig(bearing_sigma_deg=1.8).bearing_sigma_rad == pytest.approx(0.031415926)


@pytest.mark.parametrize("key", ["confusion", "miss_odds", "prior_odds", "hit_odds", "max_odds"])
def test_factors_of_odds_are_more_than_nothing(key: str) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(FuseConfig).validate_python({key: 0.0})
