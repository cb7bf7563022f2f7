"""Triangles cut at the plane in front of the camera: the rasterizer wants none that reach behind it."""

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float32]
Faces = NDArray[np.int32]


def in_front(vertices: Values, attributes: Values, faces: Faces, near_m: float) -> tuple[Values, Values, Faces]:
    """Triangles, and what is left of those that reach nearer than `near_m`.

    `vertices` (N, 3) with z backwards, `attributes` (N, K), `faces` (M, 3). Sutherland and Hodgman's clipping (1974).
    """
    behind = vertices[:, 2] > -near_m
    if not behind.any():
        return vertices, attributes, faces
    hidden = behind[faces]
    count = hidden.sum(axis=1)
    whole, cut = faces[count == 0], faces[(count == 1) | (count == 2)]
    # The one vertex that lies on the other side than its two neighbours comes first.
    alone = np.where(count == 1, hidden.argmax(axis=1), (~hidden).argmax(axis=1))[(count == 1) | (count == 2)]
    first, second, third = (cut[np.arange(len(cut)), (alone + step) % 3] for step in range(3))
    both = np.column_stack([vertices, attributes])
    edges = [_cut(both[first], both[end], near_m) for end in (second, third)]
    joined = np.concatenate([both, *edges])
    on_second = len(both) + np.arange(len(cut), dtype=np.int32)
    on_third = on_second + np.int32(len(cut))
    tip = behind[second]
    triangles = [
        np.column_stack([first, on_second, on_third])[tip],
        np.column_stack([on_second, second, third])[~tip],
        np.column_stack([on_second, third, on_third])[~tip],
    ]
    kept = np.concatenate([whole, *triangles]).astype(np.int32)
    size = vertices.shape[1]
    return np.ascontiguousarray(joined[:, :size]), np.ascontiguousarray(joined[:, size:]), kept


def _cut(start: Values, end: Values, near_m: float) -> Values:
    """Where the edges from `start` to `end` (N, K) meet the plane."""
    share = (-np.float32(near_m) - start[:, 2]) / (end[:, 2] - start[:, 2])
    return np.asarray(start + share[:, None] * (end - start), np.float32)
