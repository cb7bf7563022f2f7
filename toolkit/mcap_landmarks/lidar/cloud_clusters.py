"""Points of a cloud that are of one thing: connected cells, which grow with the distance as a cloud's gaps do."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_SECTORS = 360
"""Cells of 1 degree: several columns of any LiDAR, and 0.35 m across at 20 m."""
_LINK_M, _LINK_SHARE = 0.3, 0.01
"""How long cells are, and by how much of the distance more: two or three points of a surface seen at a slant."""
_TALL_M, _TALL_SHARE = 0.4, 0.02
"""How tall cells are, and by how much of the distance more: rings of 16 beams are 2 degrees apart."""
_TIERS = 10
"""So many cells stand on each other: all that is higher counts as the topmost."""
_FARTHEST_M = 120.0

_ONWARDS = np.array([step for step in product((0, 1), (-1, 0, 1), (-1, 0, 1)) if step > (0, 0, 0)])
"""Steps to half of a cell's neighbours by sector, ring and tier; the others step to it."""

BACKGROUND = -1
"""The label of points that are of no cluster."""


def cloud_clusters(
    away_xy: NDArray[np.floating], heights_m: NDArray[np.floating], fewest: int
) -> tuple[NDArray[np.int32], int]:
    """Labels (N,) of points at places (N, 2) seen from the LiDAR and heights (N,) above ground, and how many there are.

    Points whose cells touch, at a side or a corner, are of one cluster; the cells are those of curved voxels (Park et
    al., Curved-Voxel Clustering for accurate segmentation of 3D LiDAR point clouds with real-time performance, IROS
    2019), upright. Clusters of less than `fewest` points and points beyond 120 m are background. Labels count from the
    cluster with most points on. The points may come in any order.
    """
    if not len(away_xy):
        return np.zeros(0, dtype=np.int32), 0
    x, y = away_xy[:, 0].astype(np.float32), away_xy[:, 1].astype(np.float32)
    away = np.sqrt(x * x + y * y)
    sector = np.minimum((np.arctan2(y, x) + np.float32(np.pi)) * np.float32(_SECTORS / (2 * np.pi)), _SECTORS - 1)
    ring = np.log1p(away * np.float32(_LINK_SHARE / _LINK_M)) / np.float32(_LINK_SHARE)
    tier = np.clip(heights_m / (np.float32(_TALL_M) + np.float32(_TALL_SHARE) * away), 0, _TIERS - 1)
    rings = int(np.log1p(_FARTHEST_M * _LINK_SHARE / _LINK_M) / _LINK_SHARE) + 1
    near = ring < rings
    cell = (sector.astype(np.int32) * rings + np.where(near, ring, 0).astype(np.int32)) * _TIERS + tier.astype(np.int32)
    filled = np.zeros(_SECTORS * rings * _TIERS, dtype=np.bool_)
    filled[cell[near]] = True
    of_cell = _connected(filled.reshape(_SECTORS, rings, _TIERS))
    return _by_size(np.where(near, of_cell.reshape(-1)[cell], 0), fewest)


def _connected(filled: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Cells' labels from 1 on, in their order, 0 where nothing is; the last sector is beside the first one.

    Few cells are filled, so that a graph of these is quicker to walk than all of them.
    """
    sectors, rings, tiers = filled.shape
    numbers = np.zeros((sectors + 1, rings + 2, tiers + 2), dtype=np.int32)
    count = int(np.count_nonzero(filled))
    numbers[:-1, 1:-1, 1:-1][filled] = np.arange(1, count + 1, dtype=np.int32)
    numbers[-1] = numbers[0]
    flat, own = numbers.reshape(-1), np.flatnonzero(numbers[:-1])
    rows, columns = [], []
    for step in _ONWARDS @ [(rings + 2) * (tiers + 2), tiers + 2, 1]:
        beside = flat[own + step]
        meet = np.flatnonzero(beside)
        rows.append(meet)
        columns.append(beside[meet] - 1)
    edges = np.concatenate(rows), np.concatenate(columns)
    _, of_number = connected_components(coo_matrix((np.ones(len(edges[0])), edges), (count, count)), directed=False)
    labels = np.zeros(filled.shape, dtype=np.int32)
    labels[filled] = of_number + 1
    return labels


def _by_size(labels: NDArray[np.int32], fewest: int) -> tuple[NDArray[np.int32], int]:
    """Labels from 0 on by falling size, of those that are large enough; 0 is no label before."""
    sizes = np.bincount(labels, minlength=1)
    sizes[0] = 0
    order = np.argsort(-sizes, kind="stable")
    count = int(np.count_nonzero(sizes >= max(fewest, 1)))
    rank = np.full(len(sizes), BACKGROUND, dtype=np.int32)
    rank[order[:count]] = np.arange(count)
    return rank[labels], count
