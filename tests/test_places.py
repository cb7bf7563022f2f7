"""The benchmark of the places: which landmarks are which objects, and which changes a comparison tells."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import transform_points

from tests.benchmark.places import Things, change_row, map_rows, position_row

THERE = Things(("car", "car", "bench", "person"), np.array([[0.0, 0.0], [6.0, 0.5], [12.0, 3.0], [7.0, -4.0]]))


def test_landmarks_are_objects_of_their_class_nearby_wherever_the_map_lies() -> None:
    seen = Things(
        ("bench", "car", "car", "bench", "person"),
        np.array([[12.0, 3.0], [0.0, 0.0], [6.0, 0.5], [20.0, 0.0], [9.0, -4.0]]),
    )
    moved = Things(seen.classes, transform_points(np.array([30.0, -5.0, 2.0]), seen.positions_xy))
    found, off = map_rows("place", moved, THERE)
    assert found.value == 3 / 4
    assert found.peers == {
        "landmarks": 5,
        "that are none": 2,
        "missing person": 1,
        "wrong bench": 1,
        "wrong person": 1,
    }
    assert off.cases == 3
    assert off.value == pytest.approx(0, abs=1e-9)


def test_changes_are_told_by_class() -> None:
    after = Things(("car", "car", "chair", "person"), np.array([[0.0, 0.0], [6.0, 0.5], [2.0, 3.0], [7.0, -2.0]]))
    told = {
        "bench": {"added": 0, "removed": 1},
        "person": {"added": 0, "removed": 1},
        "chair": {"added": 1, "removed": 0},
        "car": {"added": 1, "removed": 0},
    }
    row = change_row("place", {"channels": {"landmarks": {"classes": told}}}, THERE, after)
    assert (row.value, row.cases, row.peers) == (3 / 4, 4, {"told besides": 1})


def test_a_drive_without_positions_has_no_error() -> None:
    assert np.isnan(position_row("place", None).value)
