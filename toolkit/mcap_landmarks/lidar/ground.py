"""How high the points of a cloud are above the ground around them, which may slope and have kerbs."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array

Floats = NDArray[np.float32]

_SECTORS = 72
"""Sectors of 5 degrees: 0.9 m across at 10 m, where a car hides no more than a few of them."""
_NEAR_M, _STEP = 12.0, 0.125
"""Rings of 1.5 m at the LiDAR, growing with the distance: at 40 m, 6.5 m, as far apart as the rings of 64 beams are."""
_RINGS = 22
"""Up to 180 m."""
_LOW_SHARE = 0.05
"""Share of a cell's points that may lie below what is taken for its ground: noise, and echoes by way of a mirror."""
_FEWEST = 3
"""A cell of fewer points says nothing of its ground."""
_SLOPE = 0.12
"""How much steeper than the plane through all ground it may be from cell to cell: streets rise by 12 % at most (AASHTO,
Green Book 2018, table 5-2). Where it seems steeper, the cell shows no ground but what stands on it."""
_PIT_M = 0.3
"""A cell so much lower than those around it shows no ground, but a reflection."""
_FIT_ROUNDS, _FIT_SIGMA_M = 8, 0.15
"""Rounds of the plane's reweighting, and how far off the plane ground may lie before it counts less."""
_ABOVE = 4.0
"""So many times less than what lies below the plane counts what lies above: nothing is below the ground."""
_SPREADS = 12
"""So many cells far what is known of the ground reaches into what was not seen."""
_PER_M = 128
"""Heights are sorted as whole numbers, of which a metre has so many."""


def above_ground(points_m: NDArray[np.floating], origin_xy: Array) -> Floats:
    """Heights (N,) of finite points (N, 3) in the base frame above the ground around them; the LiDAR is at (2,).

    The lowest points of polar cells are ground, less what the cells around make impossible: a plane through all of them
    (iteratively reweighted least squares, what lies above it counting less) takes the slope out, a limit of slope
    between neighbours takes cars and walls out (the lower envelope of cones, a grey-scale erosion), and cells that were
    not seen lie between those around them. In the manner of Himmelsbach et al., Fast segmentation of 3D point clouds
    for ground vehicles, IV 2010, with a surface instead of lines.
    """
    away = points_m[:, :2] - origin_xy
    cells = _cell_of(away)
    plane = _plane(_lowest(*cells, points_m[:, 2]))
    # Above the plane a cell is as low at its upper end as at its lower one.
    above = points_m[:, 2] - away @ plane[:2] - plane[2]
    ground = _filled(_limited(_without_pits(_lowest(*cells, above))))
    heights: Floats = above.astype(np.float32) - _between(ground, *cells)
    return heights


def _between(ground: Array, sector: Floats, ring: Floats) -> Floats:
    """The ground's heights (N,) at places between the middles of cells (sectors, rings), level beyond the last one."""
    sector, ring = sector - np.float32(0.5), np.clip(ring - np.float32(0.5), 0, _RINGS - 1)
    left, inner = np.floor(sector), np.minimum(np.floor(ring), _RINGS - 2)
    across, along = sector - left, ring - inner
    flat = ground.astype(np.float32).reshape(-1)
    one = (left.astype(np.int32) % _SECTORS) * _RINGS + inner.astype(np.int32)
    other = (one + _RINGS) % (_SECTORS * _RINGS)
    near = flat[one] + across * (flat[other] - flat[one])
    far = flat[one + 1] + across * (flat[other + 1] - flat[one + 1])
    heights: Floats = near + along * (far - near)
    return heights


def _cell_of(away_xy: NDArray[np.floating]) -> tuple[Floats, Floats]:
    """Sector and ring (N,) of places (N, 2) seen from the LiDAR, as fractions: the first cell goes from 0 to 1."""
    x, y = away_xy[:, 0].astype(np.float32), away_xy[:, 1].astype(np.float32)
    sector = (np.arctan2(y, x) + np.float32(np.pi)) * np.float32(_SECTORS / (2 * np.pi))
    ring = np.log1p(np.sqrt(x * x + y * y) / np.float32(_NEAR_M)) / np.float32(_STEP)
    return sector.astype(np.float32, copy=False), ring.astype(np.float32, copy=False)


def _middles() -> tuple[Array, Array]:
    """Where the cells' middles are (sectors, rings), seen from the LiDAR."""
    angle = (np.arange(_SECTORS) + 0.5) * (2 * np.pi / _SECTORS) - np.pi
    away = _NEAR_M * np.expm1((np.arange(_RINGS) + 0.5) * _STEP)
    return np.cos(angle)[:, None] * away, np.sin(angle)[:, None] * away


def _lowest(sector: Floats, ring: Floats, heights_m: NDArray[np.floating]) -> Array:
    """The low height (sectors, rings) of each cell; not a number where it has too few points."""
    cell = np.minimum(sector.astype(np.int32), _SECTORS - 1) * _RINGS + np.minimum(ring.astype(np.int32), _RINGS - 1)
    heights = np.clip(np.round(heights_m * _PER_M), -(2**15), 2**15 - 1).astype(np.int32) + 2**15
    key = np.sort(cell << 16 | heights)  # one sort by cell, then height
    first = np.searchsorted(key, np.arange(_SECTORS * _RINGS + 1, dtype=np.int32) << 16)
    count = np.diff(first)
    low: Array = np.full(_SECTORS * _RINGS, np.nan)
    known = count >= _FEWEST
    picked = key[(first[:-1] + (count * _LOW_SHARE).astype(np.intp))[known]] & 0xFFFF
    low[known] = (picked - 2**15) / _PER_M
    return low.reshape(_SECTORS, _RINGS)


def _plane(low: Array) -> Array:
    """Slopes along x and y, and height (3,), of the plane that low cells (sectors, rings) lie on or above."""
    x, y = _middles()
    known = np.isfinite(low)
    if np.count_nonzero(known) < _FEWEST:
        return np.array([0.0, 0.0, float(np.median(low[known])) if known.any() else 0.0])
    rows, heights = np.stack([x[known], y[known], np.ones(np.count_nonzero(known))], axis=1), low[known]
    plane = np.array([0.0, 0.0, float(np.quantile(heights, 0.25))])
    # A far cell stands for more ground, but the near ones are what objects stand on.
    nearness = 1.0 / (1.0 + np.hypot(rows[:, 0], rows[:, 1]) / _NEAR_M)
    for _ in range(_FIT_ROUNDS):
        off = heights - rows @ plane
        spread = np.where(off > 0, _FIT_SIGMA_M, _ABOVE * _FIT_SIGMA_M)
        weights = nearness / (1.0 + (off / spread) ** 2) ** 2  # Geman and McClure
        sums = rows.T @ (weights[:, None] * rows) + np.diag([1e-3, 1e-3, 0.0])  # few cells in a row give no slope
        plane = np.linalg.solve(sums + 1e-9 * np.eye(3), rows.T @ (weights * heights))
    return plane


def _around(cells: Array) -> NDArray[np.float64]:
    """What the eight cells around each one hold (8, sectors, rings); not a number beyond the first and last ring."""
    beyond = np.full((_SECTORS, 1), np.nan)
    inner, outer = np.hstack([beyond, cells[:, :-1]]), np.hstack([cells[:, 1:], beyond])
    return np.stack([np.roll(part, turn, axis=0) for part in (inner, cells, outer) for turn in (-1, 0, 1)])[
        [0, 1, 2, 3, 5, 6, 7, 8]
    ]


def _without_pits(rest: Array) -> Array:
    """Cells without those that lie far below all around them."""
    around = _around(rest)
    middle = np.where(np.isfinite(around), around, np.inf)
    lowest = np.sort(middle, axis=0)[1]  # the second lowest: a pit may have a part in two cells
    return np.where((rest < lowest - _PIT_M) & np.isfinite(lowest), np.nan, rest)


def _limited(rest: Array) -> Array:
    """Cells lowered to what the slope from any other cell allows; cells without a value keep none."""
    away = _NEAR_M * np.expm1((np.arange(_RINGS) + 0.5) * _STEP)
    along = _SLOPE * np.diff(away)
    across = _SLOPE * away * (2 * np.pi / _SECTORS)
    low = np.where(np.isfinite(rest), rest, np.inf)
    for _ in range(_SPREADS):
        low = np.minimum(low, np.minimum(np.roll(low, 1, axis=0), np.roll(low, -1, axis=0)) + across)
        low[:, 1:] = np.minimum(low[:, 1:], low[:, :-1] + along)
        low[:, :-1] = np.minimum(low[:, :-1], low[:, 1:] + along)
    return np.where(np.isfinite(rest), low, np.nan)


def _filled(rest: Array) -> Array:
    """Cells with a value for each: the mean of those around it, from the known ones inwards, and 0 beyond."""
    filled = rest
    for _ in range(_SPREADS):
        missing = ~np.isfinite(filled)
        if not missing.any():
            return filled
        around = _around(filled)
        known = np.isfinite(around)
        count = known.sum(axis=0)
        mean = np.where(known, around, 0.0).sum(axis=0) / np.maximum(count, 1)
        filled = np.where(missing & (count > 0), mean, filled)
    return np.where(np.isfinite(filled), filled, 0.0)
