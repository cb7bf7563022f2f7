"""Boxes of one thing become one: vehicles told twice, and riders with what they ride."""

import numpy as np
import pytest
from mcap_landmarks.fusion.seen_things import Seen, seen_things
from mcap_landmarks.messages.detections import Detections

Told = tuple[str, float, tuple[float, float, float, float]]


def things(*boxes: Told) -> list[Seen]:
    return seen_things(
        Detections(
            1,
            "camera",
            ("",) * len(boxes),
            tuple(((name, score),) for name, score, _ in boxes),
            np.array([box for *_, box in boxes], dtype=float).reshape(-1, 4),
        )
    )


def test_a_vehicle_with_two_boxes_is_one_of_two_classes() -> None:
    (found,) = things(("truck", 0.3, (100, 100, 200, 180)), ("car", 0.6, (102, 101, 203, 182)))
    assert [name for name, _ in found.classes] == ["car", "truck"]
    np.testing.assert_allclose([share for _, share in found.classes], [2 / 3, 1 / 3])
    assert found.score == 0.6
    assert found.boxes == 2
    assert found.box_xyxy.tolist() == [102, 101, 203, 182]


def test_what_has_two_wheels_and_two_boxes_is_one() -> None:
    (found,) = things(("bicycle", 0.5, (100, 100, 200, 180)), ("motorcycle", 0.3, (102, 101, 203, 182)))
    assert [name for name, _ in found.classes] == ["bicycle", "motorcycle"]
    assert len(things(("car", 0.5, (100, 100, 200, 180)), ("bicycle", 0.3, (102, 101, 203, 182)))) == 2


def test_vehicles_that_hide_each_other_stay_two() -> None:
    assert len(things(("car", 0.6, (100, 100, 200, 180)), ("car", 0.5, (150, 100, 260, 170)))) == 2


@pytest.mark.parametrize(("ridden", "name"), [("bicycle", "cyclist"), ("motorcycle", "motorcycle")])
def test_a_rider_and_what_it_rides_are_one(ridden: str, name: str) -> None:
    (found,) = things(("person", 0.7, (110, 50, 150, 150)), (ridden, 0.5, (100, 100, 170, 170)))
    assert found.name == name
    assert found.score == 0.7
    assert found.box_xyxy.tolist() == [100, 50, 170, 170]
    assert found.boxes == 2


@pytest.mark.parametrize(
    "bicycle",
    [(160, 90, 240, 160), (100, 20, 170, 60), (300, 100, 370, 170)],
    ids=["beside", "above", "elsewhere"],
)
def test_a_person_beside_a_bicycle_walks(bicycle: tuple[float, float, float, float]) -> None:
    assert {thing.name for thing in things(("person", 0.7, (110, 50, 150, 170)), ("bicycle", 0.5, bicycle))} == {
        "person",
        "bicycle",
    }


def test_one_bicycle_has_one_rider() -> None:
    found = things(
        ("person", 0.7, (110, 50, 150, 150)),
        ("person", 0.6, (115, 55, 155, 150)),
        ("bicycle", 0.5, (100, 100, 170, 170)),
    )
    assert sorted(thing.name for thing in found) == ["cyclist", "person"]


def test_the_surest_comes_first_and_nothing_is_nothing() -> None:
    found = things(("dog", 0.3, (0, 0, 9, 9)), ("cat", 0.9, (50, 0, 59, 9)))
    assert [thing.name for thing in found] == ["cat", "dog"]
    assert things() == []
