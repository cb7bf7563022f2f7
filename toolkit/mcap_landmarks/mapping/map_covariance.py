"""Covariances of a map's landmarks, from the factored normal equations of its graph."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import GraphSolution

Array = NDArray[np.float64]

# Columns of the inverse that are held at once: of a map with 10,000 poses they take 50 MB.
_COLUMNS_AT_ONCE = 200


def landmark_covariances(solved: GraphSolution, *, free_frame: bool) -> Array:
    """Covariances (L, 2, 2) of the landmarks; in a free frame without what moves all of them as one rigid body.

    That part says where the robot stood when it switched on, not how good the map is. It leaves by an S-transformation
    (Baarda 1973) to inner constraints (Meissl 1969): neither centre nor mean direction of the landmarks have an error.
    """
    xy = solved.state.landmarks_xy
    first = len(solved.free) - xy.size
    blocks = np.empty((len(xy), 2, 2))
    for start in range(0, xy.size, _COLUMNS_AT_ONCE):
        columns = np.arange(start, min(start + _COLUMNS_AT_ONCE, xy.size))
        unit = np.zeros((len(solved.free), len(columns)))
        unit[first + columns, np.arange(len(columns))] = 1
        part = solved.factor.solve(unit)[first:].reshape(-1, 2, len(columns))
        for axis in (0, 1):
            own = columns[axis::2]
            blocks[own // 2, :, axis] = part[own // 2, :, own - start]
    return _with_inner_constraints(blocks, solved) if free_frame else blocks


def _with_inner_constraints(blocks: Array, solved: GraphSolution) -> Array:
    """The landmarks' covariances (L, 2, 2) once a shift and a turn of all of them are taken out."""
    rigid = _rigid_motions(solved.state.landmarks_xy)
    right = np.zeros((len(solved.free), 3))
    right[-len(rigid) :] = rigid
    across = solved.factor.solve(right)[-len(rigid) :].reshape(-1, 2, 3)
    rigid_rows = rigid.reshape(-1, 2, 3)
    common = rigid.T @ across.reshape(-1, 3)
    cross = across @ rigid_rows.swapaxes(1, 2)
    return np.asarray(blocks - cross - cross.swapaxes(1, 2) + rigid_rows @ common @ rigid_rows.swapaxes(1, 2))


def _rigid_motions(xy: Array) -> Array:
    """An orthonormal basis (2 L, 3) of what shifts of all points (L, 2) and turns about their centre do to them."""
    centred = xy - xy.mean(axis=0)
    rigid = np.zeros((xy.size, 3))
    rigid[0::2, 0] = rigid[1::2, 1] = 1
    rigid[0::2, 2], rigid[1::2, 2] = -centred[:, 1], centred[:, 0]
    return np.asarray(np.linalg.qr(rigid)[0])
