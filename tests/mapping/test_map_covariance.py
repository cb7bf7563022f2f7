"""Covariances of landmarks against dense matrices, with and without the freedom of the whole map."""

import numpy as np
import pytest
from mcap_landmarks.estimation.factor_graph import minimise
from mcap_landmarks.mapping import map_covariance
from mcap_landmarks.mapping.map_covariance import landmark_covariances

from tests.estimation.graphs import SQUARE, graph_of
from tests.mapping.drives import Array

LANDMARKS = slice(-6, None)


def dense(known: list[int]) -> tuple[Array, Array]:
    """Covariance (6, 6) of all landmarks, by inverting the normal equations, and ours (3, 2, 2)."""
    solved = minimise(graph_of(SQUARE, np.array(known, dtype=np.int64)), SQUARE, 1.0)
    whole = np.linalg.inv((solved.jacobian.T @ solved.jacobian).toarray())[LANDMARKS, LANDMARKS]
    return whole, landmark_covariances(solved, free_frame=not known)


def blocks(covariance: Array) -> Array:
    return np.array([covariance[i : i + 2, i : i + 2] for i in (0, 2, 4)])


@pytest.mark.parametrize("at_once", [200, 4, 2])
def test_in_a_known_frame_they_are_those_of_the_inverse(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_covariance, "_COLUMNS_AT_ONCE", at_once)
    whole, found = dense([0, 2])
    np.testing.assert_allclose(found, blocks(whole), rtol=1e-6)


def test_in_a_free_frame_shifts_and_turns_of_the_whole_are_no_errors() -> None:
    """Inner constraints: what a fit of shift and turn to the landmarks would leave of their errors."""
    whole, found = dense([])
    centred = SQUARE.landmarks_xy - SQUARE.landmarks_xy.mean(axis=0)
    rigid = np.zeros((6, 3))
    rigid[0::2, 0], rigid[1::2, 1] = 1, 1
    rigid[:, 2] = np.stack([-centred[:, 1], centred[:, 0]], axis=1).ravel()
    left = np.eye(6) - rigid @ np.linalg.inv(rigid.T @ rigid) @ rigid.T
    np.testing.assert_allclose(found, blocks(left @ whole @ left.T), rtol=1e-5, atol=1e-9)
    assert (np.trace(found, axis1=1, axis2=2) < np.trace(blocks(whole), axis1=1, axis2=2)).all()
