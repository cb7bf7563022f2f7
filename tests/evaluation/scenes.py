"""Scene objects from classes and positions, for tests."""

import numpy as np
from mcap_landmarks.messages.scene import SceneObjects
from numpy.typing import ArrayLike


def scene(classes: list[str], positions_xy: ArrayLike, stamp_ns: int = 0, ids: list[str] | None = None) -> SceneObjects:
    """Objects of one class each, with unknown covariance and radius."""
    n = len(classes)
    return SceneObjects(
        stamp_ns,
        "map",
        tuple(ids or [str(i) for i in range(n)]),
        tuple(((name, 1.0),) for name in classes),
        np.array(positions_xy, dtype=np.float64).reshape(-1, 2),
        np.zeros((n, 2, 2)),
        np.zeros(n),
    )
