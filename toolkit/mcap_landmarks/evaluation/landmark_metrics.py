"""How well a map's landmarks agree with the reference."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.evaluation.alignment import fit, search
from mcap_landmarks.evaluation.pose_metrics import Figures
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.scene import SceneObjects

GATE_M = 3.0
"""A landmark that is farther off than this is missing, and another one spurious."""
_ROUNDS = 20
"""Fit and pairing take turns until nothing changes; this ends them if they run in a circle."""


def landmark_figures(estimate: SceneObjects, reference: SceneObjects) -> Figures:
    """The field `map` of an evaluation: counts, and RMSE in metres as it stands and after one SE(2) fit."""
    mine, theirs = associate(estimate, reference)
    src, dst = estimate.positions_xy[mine], reference.positions_xy[theirs]
    aligned = transform_points(fit(src, dst), src)
    return {
        "landmarks": len(estimate),
        "reference": len(reference),
        "matched": len(mine),
        "missing": len(reference) - len(mine),
        "spurious": len(estimate) - len(mine),
        "rmse_aligned_m": _rmse(aligned - dst),
        "rmse_m": _rmse(src - dst),
    }


def associate(
    estimate: SceneObjects, reference: SceneObjects, gate_m: float = GATE_M
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (K,) into both of the landmarks that are the same.

    A class that both have once is the same landmark, however far off. The others are assigned by class and position
    after an SE(2) fit, within `gate_m` of it; that fit starts from the unique ones if they are two or more, else from
    the best of a search.
    """
    comparable = _same_class(estimate, reference)
    unique = _unique_classes(estimate, reference)
    mine, theirs = unique
    if len(mine) < 2:
        _, partner = search(estimate.positions_xy, reference.positions_xy, comparable, gate_m / 3)
        mine, theirs = np.flatnonzero(partner >= 0), partner[partner >= 0]
    for _ in range(_ROUNDS):
        moved = transform_points(
            fit(estimate.positions_xy[mine], reference.positions_xy[theirs]), estimate.positions_xy
        )
        before = mine, theirs
        mine, theirs = _assign(moved, reference.positions_xy, comparable, unique, gate_m)
        if np.array_equal(mine, before[0]) and np.array_equal(theirs, before[1]):
            break
    return mine, theirs


def _same_class(estimate: SceneObjects, reference: SceneObjects) -> NDArray[np.bool_]:
    mine, theirs = np.array(estimate.classes, dtype=np.str_), np.array(reference.classes, dtype=np.str_)
    same: NDArray[np.bool_] = mine[:, None] == theirs
    return same


def _unique_classes(estimate: SceneObjects, reference: SceneObjects) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    classes, others = estimate.classes, reference.classes
    counts, other_counts = Counter(classes), Counter(others)
    mine = [i for i, name in enumerate(classes) if counts[name] == 1 == other_counts[name]]
    theirs = [others.index(classes[i]) for i in mine]
    return np.array(mine, dtype=np.int64), np.array(theirs, dtype=np.int64)


def _assign(
    moved_xy: Array,
    reference_xy: Array,
    comparable: NDArray[np.bool_],
    unique: tuple[NDArray[np.int64], NDArray[np.int64]],
    gate_m: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    cost = np.linalg.norm(moved_xy[:, None] - reference_xy, axis=-1) ** 2
    # beyond the gate a pair costs more than leaving both out, so no assignment gains by it
    cost = np.where(comparable & (cost <= gate_m**2), cost - gate_m**2, 0.0)
    cost[unique] = -2 * gate_m**2
    mine, theirs = linear_sum_assignment(cost)
    kept = cost[mine, theirs] < 0
    return mine[kept], theirs[kept]


def _rmse(errors_xy: Array) -> float | None:
    return float(np.sqrt(np.mean(np.sum(errors_xy**2, axis=1)))) if len(errors_xy) else None
