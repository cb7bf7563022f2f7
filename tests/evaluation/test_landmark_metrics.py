"""Maps against the objects of the truth."""

import numpy as np
import pytest
from mcap_landmarks.evaluation.landmark_metrics import associate, landmark_figures
from mcap_landmarks.geometry.se2 import transform_points

from tests.evaluation.scenes import scene

CORNERS = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
MOVED = np.array([7.0, -3.0, 2.0])


def test_unique_classes_match_however_far_off() -> None:
    mine = scene(["d", "a", "b", "x"], [[90, 90], [0, 0], [10, 0], [1, 1]])
    figures = landmark_figures(mine, scene(["a", "b", "c", "d"], CORNERS))
    assert figures["matched"] == 3
    assert (figures["missing"], figures["spurious"]) == (1, 1)
    assert figures["rmse_m"] == pytest.approx(np.hypot(90, 80) / np.sqrt(3))


def test_a_moved_map_is_perfect_once_aligned() -> None:
    mine = scene(["a", "b", "c", "d"], transform_points(MOVED, CORNERS))
    figures = landmark_figures(mine, scene(["a", "b", "c", "d"], CORNERS))
    assert figures["rmse_aligned_m"] == pytest.approx(0, abs=1e-12)
    away = transform_points(MOVED, CORNERS) - CORNERS
    assert figures["rmse_m"] == pytest.approx(np.sqrt(np.mean(np.sum(away**2, axis=1))))


def test_repeated_classes_match_by_position() -> None:
    rng = np.random.default_rng(0)
    world = rng.uniform(-30, 30, (40, 2))
    classes = [("person", "suitcase")[i % 2] for i in range(40)]
    order = rng.permutation(40)[:35]
    noise = rng.normal(0, 0.1, (35, 2))
    positions = np.vstack([transform_points(MOVED, world[order]) + noise, [[300, 300]]])
    mine, theirs = associate(scene([classes[i] for i in order] + ["person"], positions), scene(classes, world))
    assert theirs.tolist() == order.tolist()
    assert mine.tolist() == list(range(35))


def test_neighbours_of_one_class_are_assigned_jointly() -> None:
    """Each of two takes the one that is left, though both are nearest to the same."""
    anchors, spots = [[0, 0], [20, 0], [0, 20]], [[10.0, 10.0], [11.5, 10.0]]
    reference = scene(["a", "b", "c", "person", "person"], anchors + spots)
    mine = scene(["a", "b", "c", "person", "person"], [*anchors, [10.1, 10.0], [10.4, 10.0]])
    assert associate(mine, reference)[1].tolist() == [0, 1, 2, 3, 4]


def test_beyond_the_gate_is_missing_and_spurious() -> None:
    anchors = [[0, 0], [20, 0], [0, 20]]
    reference = scene(["a", "b", "c", "person", "person"], [*anchors, [10, 10], [40, 40]])
    figures = landmark_figures(scene(["a", "b", "c", "person", "person"], [*anchors, [12.9, 10], [46, 40]]), reference)
    assert (figures["matched"], figures["missing"], figures["spurious"]) == (4, 1, 1)


def test_classes_never_mix() -> None:
    figures = landmark_figures(scene(["person"] * 2, [[0, 0], [5, 5]]), scene(["suitcase"] * 2, [[0, 0], [5, 5]]))
    assert (figures["matched"], figures["rmse_m"], figures["rmse_aligned_m"]) == (0, None, None)


@pytest.mark.parametrize(("mine", "theirs"), [(0, 2), (2, 0), (0, 0)])
def test_empty_maps(mine: int, theirs: int) -> None:
    figures = landmark_figures(scene(["a", "b"][:mine], CORNERS[:mine]), scene(["a", "b"][:theirs], CORNERS[:theirs]))
    assert (figures["missing"], figures["spurious"], figures["rmse_m"]) == (theirs, mine, None)
