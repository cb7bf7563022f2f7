"""Scene objects made fit to use: unusable ones and what moves dropped and counted, unknown covariances filled in."""

from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.classes import is_movable
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scene import SceneObjects

# Two objects of one class stand farther apart than this.
_SAME_PLACE_M = 0.05
# No position is known better than to a tenth of a millimetre; a smaller sigma would make a fit singular.
_LEAST_M = 1e-4


def pick(scene: SceneObjects, rows: Sequence[int] | NDArray[np.int64]) -> SceneObjects:
    """The objects of some rows."""
    keep = np.asarray(rows, dtype=np.int64)
    return SceneObjects(
        scene.stamp_ns,
        scene.frame_id,
        tuple(scene.ids[i] for i in keep),
        tuple(scene.hypotheses[i] for i in keep),
        scene.positions_xy[keep],
        scene.covariances[keep],
        scene.radii_m[keep],
    )


def usable(scene: SceneObjects, dropped: Counter[str]) -> SceneObjects:
    """Objects with a class, finite numbers and a covariance that is positive definite or all zero (unknown), each once.

    What else the scene holds is left out and counted by reason in `dropped`.
    """
    finite = np.isfinite(scene.positions_xy).all(axis=1) & np.isfinite(scene.covariances).all(axis=(1, 2))
    a, b, c = scene.covariances[:, 0, 0], scene.covariances[:, 0, 1], scene.covariances[:, 1, 1]
    unknown: NDArray[np.bool_] = np.logical_not(scene.covariances.any(axis=(1, 2)))
    with np.errstate(invalid="ignore", over="ignore"):
        symmetric = np.abs(b - scene.covariances[:, 1, 0]) <= 1e-6 * (np.abs(a) + np.abs(c))
        definite = symmetric & (a > 0) & (c > 0) & (a * c - b * b > 0)
    named = np.array([bool(options) for options in scene.hypotheses], dtype=np.bool_)
    dropped["objects with numbers that are not finite"] += int((~finite).sum())
    dropped["objects whose covariance is not positive definite"] += int((finite & ~unknown & ~definite).sum())
    dropped["objects without a class"] += int((finite & (unknown | definite) & ~named).sum())
    keep = finite & (unknown | definite) & named
    again = _repeated(scene, np.flatnonzero(keep))
    dropped["objects that repeat another one of the same class and place"] += len(again)
    keep[again] = False
    return scene if keep.all() else pick(scene, np.flatnonzero(keep))


def standing(scene: SceneObjects, moving_ids: Collection[str], dropped: Counter[str], *, fixed: bool) -> SceneObjects:
    """The objects that can be landmarks: what stands, and if only what is `fixed` counts, nothing of a movable class.

    What else the scene holds is left out and counted by reason and class in `dropped`.
    """
    keep = []
    for i, (name, class_name) in enumerate(zip(scene.ids, scene.classes, strict=True)):
        if name in moving_ids:
            dropped[f"objects that seem to move: {class_name}"] += 1
        elif fixed and is_movable(class_name):
            dropped[f"objects that may stand elsewhere another day: {class_name}"] += 1
        else:
            keep.append(i)
    return scene if len(keep) == len(scene) else pick(scene, keep)


def _repeated(scene: SceneObjects, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of some rows that show the same as an earlier one."""
    classes = np.unique([scene.classes[i] for i in rows], return_inverse=True)[1]
    apart = np.linalg.norm(scene.positions_xy[rows, None] - scene.positions_xy[rows], axis=-1)
    same = (apart < _SAME_PLACE_M) & (classes[:, None] == classes)
    repeated: NDArray[np.int64] = rows[np.tril(same, -1).any(axis=1)]
    return repeated


def known_covariances(scene: SceneObjects, range_sigma_m: float, bearing_sigma_rad: float) -> Array:
    """Covariances (N, 2, 2) in m^2, those that are unknown from the sigmas of range and bearing.

    No direction is known better than to a tenth of a millimetre, whatever a log says.
    """
    x, y = scene.positions_xy[:, 0], scene.positions_xy[:, 1]
    polar = np.diag([range_sigma_m**2, bearing_sigma_rad**2])
    _, filled = points_from_polar(np.hypot(x, y), np.arctan2(y, x), polar)
    unknown: NDArray[np.bool_] = np.logical_not(scene.covariances.any(axis=(1, 2)))
    known = np.where(unknown[:, None, None], filled, scene.covariances)
    xx, yy, xy = known[:, 0, 0], known[:, 1, 1], known[:, 0, 1]
    least = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)
    floored: Array = known + np.where(least < _LEAST_M**2, _LEAST_M**2, 0.0)[:, None, None] * np.eye(2)
    return floored
