"""The pose that fits points to landmarks best, in closed form: weighted orthogonal Procrustes in the plane."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def fit(
    landmark_x: Array, landmark_y: Array, point_x: Array, point_y: Array, weight: Array
) -> tuple[Array, Array, Array, Array]:
    """Transforms map_from_base as x, y, cosine and sine, each (B,), of points (K, B) seen at landmarks (K, B).

    Minimises the weighted squared distances (Umeyama 1991, without scale). A column whose weights are all zero, or
    whose points coincide, gets heading zero.
    """
    total = weight.sum(axis=0)
    share = weight / np.where(total > 0, total, 1.0)
    lx, ly = (share * landmark_x).sum(axis=0), (share * landmark_y).sum(axis=0)
    px, py = (share * point_x).sum(axis=0), (share * point_y).sum(axis=0)
    dx, dy = share * (landmark_x - lx), share * (landmark_y - ly)
    cosine = (dx * point_x + dy * point_y).sum(axis=0)
    sine = (dy * point_x - dx * point_y).sum(axis=0)
    norm = np.sqrt(cosine * cosine + sine * sine)
    known = norm > 0
    norm = np.where(known, norm, 1.0)
    cosine, sine = np.where(known, cosine, 1.0) / norm, sine / norm
    return lx - cosine * px + sine * py, ly - sine * px - cosine * py, cosine, sine
