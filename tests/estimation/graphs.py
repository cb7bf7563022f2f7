"""Small factor graphs without noise, from the state that they fit."""

import numpy as np
from mcap_landmarks.estimation.factor_graph import Graph, State
from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.angles import wrap
from numpy.typing import NDArray

from tests.estimation.worlds import Array

Ints = NDArray[np.int64]

SQUARE = State(
    np.array([[0.0, 0.0, 0.0], [2.0, 0.5, 0.8], [3.0, 3.0, 2.0], [0.5, 2.5, -2.5]]),
    np.array([[1.0, 2.0], [4.0, 1.0], [-1.0, 3.5]]),
)
"""Four poses around three landmarks."""


def graph_of(state: State, known: Ints | None = None) -> Graph:
    """Every landmark seen from every pose, each pose moved to from the one before; what is `known` is so beforehand."""
    poses, landmarks = len(state.poses), len(state.landmarks_xy)
    pose, landmark = (a.ravel() for a in np.mgrid[:poses, :landmarks])
    d = state.landmarks_xy[landmark] - state.poses[pose, :2]
    bearing = wrap(np.arctan2(d[:, 1], d[:, 0]) - state.poses[pose, 2])
    rng = np.random.default_rng(0)
    known = np.empty(0, dtype=np.int64) if known is None else known
    return Graph(
        pose,
        landmark,
        np.hypot(d[:, 0], d[:, 1]),
        bearing,
        roots(rng, len(pose), 2),
        np.arange(poses - 1),
        se2.between(state.poses[:-1], state.poses[1:]),
        roots(rng, poses - 1, 3),
        known,
        state.landmarks_xy[known],
        roots(rng, len(known), 2),
    )


def roots(rng: np.random.Generator, count: int, size: int) -> Array:
    """Whitening matrices (count, size, size) that mix all numbers of a residual."""
    return np.asarray(rng.normal(0, 2, (count, size, size)) + 10 * np.eye(size))
