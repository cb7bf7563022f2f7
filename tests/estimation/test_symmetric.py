"""Small symmetric matrices in closed form, against numpy."""

import numpy as np
import pytest
from mcap_landmarks.estimation.symmetric import Symmetric3, Vector3, factor3, inverse2, inverse3, solve3

from tests.estimation.worlds import Array


def symmetric(matrices: Array) -> Symmetric3:
    pairs = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
    return Symmetric3(*(matrices[:, i, j] for i, j in pairs))


def test_three_by_three_as_numpy_has_it() -> None:
    root = np.random.default_rng(0).normal(size=(200, 3, 5))
    matrices = root @ root.swapaxes(1, 2)
    right = np.random.default_rng(1).normal(size=(200, 3))
    factor = factor3(symmetric(matrices))
    assert factor.regular.all()
    np.testing.assert_allclose(inverse3(factor), np.linalg.inv(matrices), rtol=1e-6, atol=1e-8)
    solved = np.stack(solve3(factor, Vector3(*right.T)), axis=-1)
    np.testing.assert_allclose(solved, np.linalg.solve(matrices, right[..., None])[..., 0], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("damping", [0.5, np.linspace(0, 2, 200)], ids=["one", "each"])
def test_damping_is_a_share_of_the_diagonal(damping: float | Array) -> None:
    root = np.random.default_rng(0).normal(size=(200, 3, 5))
    matrices = root @ root.swapaxes(1, 2)
    damped = matrices + np.reshape(damping, (-1, 1, 1)) * matrices * np.eye(3)
    factor = factor3(symmetric(matrices), damping)
    np.testing.assert_allclose(inverse3(factor), np.linalg.inv(damped), rtol=1e-6, atol=1e-8)


def test_singular_matrices_solve_to_zero_and_invert_to_infinity() -> None:
    matrices = np.stack(
        [
            np.zeros((3, 3)),
            np.ones((3, 3)),
            np.diag([1.0, 0, 1]),
            np.diag([0.0, 1, 1]),
            np.diag([1.0, 1, -1]),
            np.eye(3),
        ]
    )
    factor = factor3(symmetric(matrices))
    assert factor.regular.tolist() == [False] * 5 + [True]
    step = np.stack(solve3(factor, Vector3(*np.ones((3, 6)))), axis=-1)
    np.testing.assert_array_equal(step[[0, 1, 5]], [[0] * 3, [0] * 3, [1] * 3])
    inverse = inverse3(factor)
    np.testing.assert_array_equal(inverse[:5], np.tile(np.diag([np.inf] * 3), (5, 1, 1)))
    np.testing.assert_array_equal(inverse[5], np.eye(3))


@pytest.mark.parametrize(("part", "regular"), [(1e-14, False), (1e-12, True)])
def test_a_pivot_of_rounding_noise_is_none(part: float, regular: bool) -> None:
    nearly = np.eye(3)[None].copy()
    nearly[0, :2, :2] = [[1, 1], [1, 1 + part]]
    assert factor3(symmetric(nearly)).regular.tolist() == [regular]
    turned = nearly[:, [2, 0, 1]][:, :, [2, 0, 1]]
    assert factor3(symmetric(turned)).regular.tolist() == [regular]


def test_two_by_two_inverses_are_zero_where_there_is_none() -> None:
    bad = [[[1.0, 2], [2, 1]], [[0, 0], [0, 0]], [[-1, 0], [0, -1]], [[1, 0], [0, 0]]]
    matrices = np.array([[[2.0, 1], [1, 3]], *bad])
    xx, xy, yy = inverse2(matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1])
    np.testing.assert_allclose([xx[0], xy[0], yy[0]], [0.6, -0.2, 0.4])
    assert not np.any([xx[1:], xy[1:], yy[1:]])
    alone = inverse2(*(np.array([value]) for value in (2.0, 1.0, 3.0)))
    np.testing.assert_allclose(np.ravel(alone), [0.6, -0.2, 0.4])
