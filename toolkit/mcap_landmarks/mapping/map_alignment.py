"""Where one map of classed landmarks lies in another, without any guess: maximum consensus over pairs of landmarks."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig

# A nearer pair says too little about direction: a decimetre turns it by 11 degrees.
_NEAR_M = 0.5
# Lengths that differ by no more are alike: two ends that are each a bit less than the tolerance off make as much.
_LIKE_M = 0.5
# Classes so far apart in the search tree, in the same unit as lengths, are never like each other.
_APART = 200.0
# Poses that are tried, evenly chosen where there are more: with 100 landmarks they take 0.6 s.
_TRIED = 20_000
# Where classes repeat, two landmarks fit somewhere by chance: their poses are made from two.
_FEWEST, _FEWEST_DISTINCT = 3, 2
# Poses further apart than so many tolerances or than this angle are other ways to lay the map.
_OTHER_TOLERANCES, _OTHER_RAD = 4, 0.5
# Of the landmarks within so many tolerances of any in the map, this share has one of its class within so many: of logs
# of the same made-up world (12 to 80 landmarks of 2 to 8 classes, 0.15 m off) 0.72 to 1 have, where one of another
# world, or of one that is larger by a fifth, fits best 0.1 to 0.57.
_AMONG_TOLERANCES, _PARTNER_TOLERANCES, _PARTNERS = 5, 2, 0.6


class Alignment(NamedTuple):
    """map_from_local (3,) and how many landmarks it lays on others of the map; no pose, but the reason, if none is."""

    pose: Array | None
    common: int = 0
    reason: str = ""


def align_maps(
    class_ids: NDArray[np.int64],
    points_xy: Array,
    map_class_ids: NDArray[np.int64],
    map_xy: Array,
    config: BuildMapConfig,
) -> Alignment:
    """The pose under which most of the landmarks (N, 2) fall on map landmarks (M, 2) of their class.

    Hypothesise and verify, as in RANSAC (Fischler and Bolles 1981) but without chance: every pair of landmarks that
    stand half a metre to `join_reach_m` apart is laid on every pair of the map of the same classes and length; the pose
    with most landmarks within `join_tolerance_m` of a partner wins. There is none if fewer than three (two, where the
    map's classes are all different) fit, another pose fits as many, or too many stand where the map has others.
    """
    reach_m, tolerance_m = config.join_reach_m, config.join_tolerance_m
    mine, theirs = _pairs(class_ids, points_xy, reach_m), _pairs(map_class_ids, map_xy, reach_m)
    poses = _hypotheses(class_ids, points_xy, mine, map_class_ids, map_xy, theirs)
    scores = _scores(poses, class_ids, points_xy, map_class_ids, map_xy, tolerance_m)
    most = int(scores.max(initial=0))
    distinct = len(np.unique(map_class_ids)) == len(map_class_ids)
    if most < (_FEWEST_DISTINCT if distinct else _FEWEST):
        return Alignment(None, most, "too few landmarks in common")
    pose = poses[np.argmax(scores)]
    apart = np.linalg.norm(poses[:, :2] - pose[:2], axis=1) > _OTHER_TOLERANCES * tolerance_m
    apart |= np.cos(poses[:, 2] - pose[2]) < np.cos(_OTHER_RAD)
    if scores[apart].max(initial=0) >= most:
        return Alignment(None, most, "it fits in several ways")
    if not _has_partners(transform_points(pose, points_xy), class_ids, map_class_ids, map_xy, tolerance_m):
        return Alignment(None, most, "where it fits best, most of its landmarks stand beside others")
    return Alignment(pose, most)


def _has_partners(
    points: Array, class_ids: NDArray[np.int64], map_class_ids: NDArray[np.int64], map_xy: Array, tolerance_m: float
) -> bool:
    """Whether enough of the landmarks that stand among the map's stand where it has one of their class."""
    among = np.asarray(cKDTree(map_xy).query(points)[0]) <= _AMONG_TOLERANCES * tolerance_m
    distance = np.linalg.norm(points[among][:, None] - map_xy, axis=2)
    distance[class_ids[among][:, None] != map_class_ids] = np.inf
    partners = (distance.min(axis=1) <= _PARTNER_TOLERANCES * tolerance_m).sum()
    return bool(partners >= _PARTNERS * among.sum())


def _pairs(class_ids: NDArray[np.int64], points_xy: Array, reach_m: float) -> NDArray[np.int64]:
    """Ordered pairs (P, 2) of rows whose distance says something about direction."""
    near = cKDTree(points_xy).query_pairs(reach_m, output_type="ndarray") if len(points_xy) else np.zeros((0, 2), int)
    pairs = np.concatenate([near, near[:, ::-1]]).astype(np.int64)
    length = np.linalg.norm(points_xy[pairs[:, 0]] - points_xy[pairs[:, 1]], axis=1)
    pairs = pairs[(length > _NEAR_M) & (class_ids[pairs[:, 0]] <= class_ids[pairs[:, 1]])]
    ordered: NDArray[np.int64] = pairs[np.lexsort(pairs.T)]
    return ordered


def _hypotheses(
    class_ids: NDArray[np.int64],
    points: Array,
    mine: NDArray[np.int64],
    map_class_ids: NDArray[np.int64],
    map_xy: Array,
    theirs: NDArray[np.int64],
) -> Array:
    """Poses (H, 3) that lay one of `mine` on one of `theirs`; evenly thinned where there are too many."""

    def features(of_class_ids: NDArray[np.int64], at: Array, pairs: NDArray[np.int64]) -> Array:
        length = np.linalg.norm(at[pairs[:, 0]] - at[pairs[:, 1]], axis=1)
        return np.column_stack([_APART * of_class_ids[pairs], length])

    if not len(mine) or not len(theirs):
        return np.zeros((0, 3))
    tree = cKDTree(features(map_class_ids, map_xy, theirs))
    near = tree.query_ball_point(features(class_ids, points, mine), _LIKE_M, return_sorted=True)
    found = [np.asarray(hits, dtype=np.int64) for hits in np.asarray(near, dtype=object)]
    rows = np.repeat(np.arange(len(mine)), [len(hits) for hits in found])
    columns = np.concatenate(found)
    if len(rows) > _TRIED:
        keep = np.linspace(0, len(rows) - 1, _TRIED).astype(np.int64)
        rows, columns = rows[keep], columns[keep]
    a, b = points[mine[rows, 0]], points[mine[rows, 1]]
    p, q = map_xy[theirs[columns, 0]], map_xy[theirs[columns, 1]]
    turn = np.arctan2(*(q - p).T[::-1]) - np.arctan2(*(b - a).T[::-1])
    c, s = np.cos(turn), np.sin(turn)
    middle, target = (a + b) / 2, (p + q) / 2
    x = target[:, 0] - c * middle[:, 0] + s * middle[:, 1]
    y = target[:, 1] - s * middle[:, 0] - c * middle[:, 1]
    return np.column_stack([x, y, turn])


def _scores(
    poses: Array,
    class_ids: NDArray[np.int64],
    points: Array,
    map_class_ids: NDArray[np.int64],
    map_xy: Array,
    tolerance_m: float,
) -> NDArray[np.int64]:
    """How many landmarks (H,) fall near one of their class under each pose."""
    scores = np.zeros(len(poses), dtype=np.int64)
    for class_id in np.unique(class_ids):
        there = map_xy[map_class_ids == class_id]
        if len(there):
            moved = transform_points(poses[:, None], points[class_ids == class_id])
            distance = np.asarray(cKDTree(there).query(moved, distance_upper_bound=tolerance_m)[0])
            scores += np.isfinite(distance).sum(axis=1)
    return scores
