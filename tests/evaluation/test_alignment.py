"""Rigid fits in the plane."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_landmarks.evaluation.alignment import fit, search
from mcap_landmarks.geometry.se2 import transform_points

POSES = st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(-3.14, 3.14)).map(np.array)
CLOUDS = arrays(np.float64, st.tuples(st.integers(2, 20), st.just(2)), elements=st.floats(-50, 50))


@pytest.mark.slow
@given(CLOUDS, POSES)
def test_fit_undoes_any_motion(points: np.ndarray, pose: np.ndarray) -> None:
    moved = transform_points(pose, points)
    np.testing.assert_allclose(transform_points(fit(points, moved), points), moved, atol=1e-9)


def test_fit_of_little() -> None:
    np.testing.assert_array_equal(fit(np.zeros((0, 2)), np.zeros((0, 2))), np.zeros(3))
    np.testing.assert_array_equal(fit(np.array([[1.0, 2]]), np.array([[4.0, 6]])), [3, 4, 0])


def test_fit_is_the_best_one() -> None:
    rng = np.random.default_rng(5)
    src, dst = rng.normal(0, 3, (2, 12, 2))
    found = fit(src, dst)

    def cost(pose: np.ndarray) -> float:
        return float(np.sum((transform_points(pose, src) - dst) ** 2))

    assert all(cost(found) < cost(found + step) for step in rng.normal(0, 1e-3, (100, 3)))


@settings(max_examples=25)
@given(POSES, st.integers(0, 1000))
def test_search_finds_maps_of_few_classes(pose: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = rng.uniform(-40, 40, (30, 2))
    classes = rng.integers(0, 3, 30)
    seen = rng.permutation(30)[:20]
    mine = transform_points(pose, world[seen] + rng.normal(0, 0.02, (20, 2)))
    comparable = classes[seen][:, None] == classes
    found, partner = search(mine, world, comparable, 1.0)
    assert np.linalg.norm(transform_points(found, transform_points(pose, world[:1])) - world[:1]) < 1.0
    assert np.mean(partner == seen) > 0.8


def test_search_without_points() -> None:
    nothing, some = np.zeros((0, 2)), np.ones((3, 2))
    pose, partner = search(some, nothing, np.zeros((3, 0), bool), 1.0)
    assert pose.tolist() == [0, 0, 0]
    assert partner.tolist() == [-1, -1, -1]
    assert not len(search(nothing, some, np.zeros((0, 3), bool), 1.0)[1])


@pytest.mark.parametrize("shift", [0.0, 0.4])
def test_search_keeps_the_identity_where_it_serves(shift: float) -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2) * 5
    pose, partner = search(grid + shift, grid, np.ones((25, 25), bool), 1.0)
    assert pose.tolist() == [0, 0, 0]
    assert partner.tolist() == list(range(25))
