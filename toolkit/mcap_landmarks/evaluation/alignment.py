"""Rigid fits in the plane: of points that belong together, and of maps where that is yet to be found."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation import procrustes
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, rotation, transform_points

# The widest pairs that are tried, the points that judge a transform, all comparisons of points (some ten seconds), and
# the share of the judges whose support ends the search: more than half cannot be had twice.
_PAIRS, _JUDGES, _BUDGET, _ENOUGH = 200, 50, 3 * 10**8, 0.5


def fit(src_xy: Array, dst_xy: Array) -> Array:
    """dst_from_src (3,) that brings points (N, 2) closest to points (N, 2): Umeyama 1991, without scale.

    One point, or points that coincide, give heading zero; none give the identity.
    """
    if not len(src_xy):
        return np.zeros(3)
    to_x, to_y, from_x, from_y = dst_xy[:, :1], dst_xy[:, 1:], src_xy[:, :1], src_xy[:, 1:]
    x, y, cosine, sine = procrustes.fit(to_x, to_y, from_x, from_y, np.ones((len(src_xy), 1)))
    return np.array([x[0], y[0], np.arctan2(sine[0], cosine[0])])


def transform_document(dst_from_src: Array) -> dict[str, float]:
    """A transform (3,) for a document, in metres and degrees."""
    x_m, y_m, heading_rad = dst_from_src.tolist()
    return {"x_m": x_m, "y_m": y_m, "heading_deg": float(np.degrees(heading_rad))}


def search(
    src_xy: Array, dst_xy: Array, comparable: NDArray[np.bool_], tolerance_m: float
) -> tuple[Array, NDArray[np.int64]]:
    """dst_from_src (3,) under which most points (N, 2) have a comparable one of (M, 2) near, and its partners (N,).

    comparable (N, M) tells which points could be the same, say by class. Every transform that brings one of the widest
    pairs of src onto a pair of dst of about its length is tried, from the identity on, until most points are supported
    or the budget is spent. Partners are -1 where there is none within `tolerance_m`.
    """
    judges = np.linspace(0, len(src_xy) - 1, min(len(src_xy), _JUDGES)).astype(np.int64)
    budget = _BUDGET // max(1, len(judges) * len(dst_xy))

    def support(transforms: Array) -> Array:
        nearest = _distances(transforms, src_xy[judges], dst_xy, comparable[judges]).min(axis=2, initial=np.inf)
        share: Array = np.clip(1 - (nearest / tolerance_m) ** 2, 0, None).mean(axis=1)
        return share

    best = np.zeros(3)
    most = support(best[None])[0] if len(judges) else 1.0
    for pair in _widest_pairs(src_xy):
        if most >= _ENOUGH or budget <= 0:
            break
        hypotheses = _hypotheses(pair, src_xy, dst_xy, comparable, tolerance_m)[:budget]
        budget -= len(hypotheses)
        for part in np.array_split(hypotheses, 1 + len(hypotheses) // 256):
            found = support(part) if len(part) else np.zeros(1)
            if found.max() > most:
                best, most = part[found.argmax()], found.max()
    distance = _distances(best[None], src_xy, dst_xy, comparable)[0]
    near = distance.min(axis=1, initial=np.inf) <= tolerance_m
    return best, np.where(near, distance.argmin(axis=1) if len(dst_xy) else 0, -1)


def _widest_pairs(points_xy: Array) -> list[tuple[int, int]]:
    first, second = np.triu_indices(len(points_xy), k=1)
    length = np.linalg.norm(points_xy[first] - points_xy[second], axis=1)
    order = np.argsort(-length, kind="stable")[:_PAIRS]
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


def _hypotheses(
    pair: tuple[int, int], src_xy: Array, dst_xy: Array, comparable: NDArray[np.bool_], tolerance_m: float
) -> Array:
    """Transforms (H, 3) that bring the pair of src onto pairs of dst of about its length."""
    i, j = pair
    ahead = src_xy[j] - src_xy[i]
    there = dst_xy[None, :] - dst_xy[:, None]
    length = np.linalg.norm(there, axis=-1)
    fits = comparable[i][:, None] & comparable[j] & (np.abs(length - np.hypot(*ahead)) <= tolerance_m)
    start, end = np.nonzero(fits & (length > 0))
    heading = wrap(np.arctan2(*there[start, end].T[::-1]) - np.arctan2(ahead[1], ahead[0]))
    middle = (dst_xy[start] + dst_xy[end]) / 2 - rotation(heading) @ ((src_xy[i] + src_xy[j]) / 2)
    return np.column_stack([middle, heading])


def _distances(transforms: Array, src_xy: Array, dst_xy: Array, comparable: NDArray[np.bool_]) -> Array:
    """(H, N, M) from each moved point of src to each point of dst, infinite where they are not comparable."""
    moved = transform_points(transforms[:, None], src_xy)
    distance = np.linalg.norm(moved[:, :, None] - dst_xy, axis=-1)
    return np.where(comparable, distance, np.inf)
