"""Where the centre of an object of known shape is, from its hits and from the beams that pass it by."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array, rotation
from toolkit.lidar.shapes import Profile, Shape, profile
from toolkit.lidar.windows import Floats, Windows

_ENOUGH = 40.0
"""A posterior that spreads over so many cells of the grid is fine enough."""
_KEPT = 40
_FINEST_LEVEL = 5
_CLEAR_M = 0.05
"""A beam that ends no more than this behind a surface may have met it."""
_SURFACE_M = 0.003
"""How far real outlines are off their shapes."""
_STRAY_RANGE_M = 0.5
_EDGE_M = 0.03
"""How much wider than its shape noise can make an object look."""


@dataclass(frozen=True, slots=True)
class Noise:
    """What a LiDAR does: standard deviation of its ranges, the share of beams that return nothing from an object, and
    the share of hits that come from something else."""

    sigma_m: float = 0.01
    dropout: float = 0.01
    stray: float = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Centres:
    """Of C clusters under one shape: log_evidence (C,), -inf where it cannot be; positions_xy (C, 2), covariances
    (C, 2, 2) in m^2, both in the base frame and meaningless where the evidence is -inf.

    The evidence is the density of the hits' ranges times the area in m^2 that the centre could lie in.
    """

    log_evidence: Array
    positions_xy: Array
    covariances: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells (C, K) of the space of positions across the view, turns and sizes, and what half of one is per cluster.

    away_m is each cell's best distance behind the clusters' origin, found from the hits.
    """

    away_m: Floats
    across_m: Floats
    turn_rad: Floats
    size: Floats
    half_across_m: Floats
    half_turn_rad: float
    half_size: float


def centres(window: Windows, shape: Shape, noise: Noise) -> Centres:
    """The posterior of the centre over position, turn and size of the shape, all equally likely before.

    Position across the view, turn and size are integrated over a grid that is refined where the posterior lies; the
    position along the view follows from the hits in closed form.
    """
    count = len(window)
    found = Centres(np.full(count, -np.inf), window.anchors_xy.copy(), np.tile(np.eye(2), (count, 1, 1)))
    rows = np.flatnonzero(_possible(window, shape))
    if not len(rows):
        return found
    seen = window.within(rows, 2 * shape.reach_m)
    cells = _first_cells(seen, shape)
    for level in range(_FINEST_LEVEL + 1):
        cells, log_weights, variance = _weigh(seen, cells, shape, noise)
        _keep(found, rows, seen, cells, log_weights, variance)
        share = _shares(log_weights)
        coarse = 1 / (share**2).sum(axis=1) < _ENOUGH
        if level == _FINEST_LEVEL or not coarse.any():
            break
        again = np.flatnonzero(coarse)
        rows, seen = rows[again], seen.within(again, np.inf)
        cells = _finer(cells, again, log_weights[again], shape)
    return found


def _possible(window: Windows, shape: Shape) -> NDArray[np.bool_]:
    """Whether clusters are no wider than the shape, and no narrower where beams pass them on both sides."""
    width = window.lateral_m[:, 1] - window.lateral_m[:, 0]
    fits = width <= 2 * shape.reach_m + _EDGE_M
    least = profile(shape).least_width_m - 2 * window.spacing_m - 4 * _SURFACE_M
    if least.max(initial=0) <= 0:
        return fits
    beside = (window.beside_m > 0) & (window.beside_m <= 1.5 * window.spacing_m[:, None])
    passed = beside & (window.ranges_m > window.abreast_m + shape.reach_m)
    possible: NDArray[np.bool_] = fits & ((width >= least) | (passed.sum(axis=1) < 2))
    return possible


def _first_cells(window: Windows, shape: Shape) -> _Cells:
    turns = 1 if shape.turn_rad == 0 else round(shape.turn_rad / (np.pi / 16))
    sizes = 1 if shape.apart_m is None else 3
    across = 32 if turns == 1 else 14
    x, t, s = (grid.ravel() for grid in np.meshgrid(_middles(across), _middles(turns), _middles(sizes), indexing="ij"))
    low, high = window.lateral_m[:, 1] - shape.reach_m, window.lateral_m[:, 0] + shape.reach_m
    low, high = np.minimum(low, high) - _SURFACE_M, np.maximum(low, high) + _SURFACE_M
    shaped = (len(window), len(x))
    return _Cells(
        np.full(shaped, 0.7 * shape.reach_m, dtype=np.float32),
        (low[:, None] + (high - low)[:, None] * x).astype(np.float32),
        np.broadcast_to(shape.turn_rad * t, shaped).astype(np.float32),
        np.broadcast_to(s, shaped).astype(np.float32),
        ((high - low) / across / 2).astype(np.float32),
        shape.turn_rad / turns / 2,
        0.5 / sizes,
    )


def _middles(count: int) -> Array:
    return (np.arange(count) + 0.5) / count


def _finer(cells: _Cells, rows: NDArray[np.intp], log_weights: Array, shape: Shape) -> _Cells:
    """The best cells of some clusters, each cut into two in every direction that counts."""
    best = np.argpartition(-log_weights, min(_KEPT, log_weights.shape[1] - 1), axis=1)[:, :_KEPT]
    axes = [(-1, 1), (-1, 1) if shape.turn_rad else (0,), (-1, 1) if shape.apart_m else (0,)]
    x, t, s = (grid.ravel().astype(np.float32) for grid in np.meshgrid(*axes, indexing="ij"))

    def cut(values: Floats, shift: Floats) -> Floats:
        chosen = np.take_along_axis(values[rows], best, axis=1)
        return np.asarray(chosen[:, :, None] + shift, dtype=np.float32).reshape(len(rows), -1)

    half = (cells.half_across_m[rows] / 2).astype(np.float32)
    turn, size = (cells.half_turn_rad / 2, cells.half_size / 2)
    return _Cells(
        cut(cells.away_m, np.zeros_like(x)),
        cut(cells.across_m, (half[:, None, None] * x).astype(np.float32)),
        cut(cells.turn_rad, np.float32(turn) * t),
        cut(cells.size, np.float32(size) * s),
        half,
        turn if shape.turn_rad else 0.0,
        size if shape.apart_m else cells.half_size,
    )


def _weigh(window: Windows, cells: _Cells, shape: Shape, noise: Noise) -> tuple[_Cells, Array, Array]:
    """The cells at their best distances, the logarithm of their weights, and the variance of those distances (C, K)."""
    shapes = profile(shape)
    wide = 0.6 * np.array(
        [
            np.square(cells.half_across_m),
            np.full_like(cells.half_across_m, (cells.half_turn_rad * shape.reach_m / 2) ** 2),
            np.full_like(cells.half_across_m, _size_m(shape, cells.half_size) ** 2 / 4),
        ]
    ).sum(axis=0)
    sharp = noise.sigma_m**2 + _SURFACE_M**2
    variance = (sharp + wide)[:, None, None]
    stray = 2 * (np.log(_STRAY_RANGE_M / noise.stray) - 0.5 * np.log(2 * np.pi * variance))
    hit = window.is_hit[:, None, :]
    for last in (False, True):
        predicted = _cast(window, cells, shapes)
        off = np.where(hit, window.ranges_m[:, None, :] - predicted, 0.0)
        met = hit & np.isfinite(off)
        off = np.where(met, off, 0.0)
        used = met & (np.abs(off) < (0.1 if last else np.inf))
        number = np.maximum(used.sum(axis=2), 1)
        shift = np.where(used, off, 0.0).sum(axis=2) / number
        cells = replace(cells, away_m=(cells.away_m + shift).astype(np.float32))
    squared = np.where(met, np.minimum((off - shift[..., None]) ** 2 / variance, stray), np.where(hit, stray, 0.0))
    reached = predicted + shift[..., None] < window.ranges_m[:, None, :] - _CLEAR_M
    missed = (reached & ~hit).sum(axis=2)
    tempered = np.sqrt(sharp / (sharp + wide))[:, None]
    hits = window.is_hit.sum(axis=1)[:, None]
    log_density = -0.5 * hits * np.log(2 * np.pi * variance[..., 0]) + 0.5 * np.log(
        2 * np.pi * variance[..., 0] / number
    )
    log_weights = log_density - 0.5 * squared.sum(axis=2) + tempered * missed * np.log(noise.dropout)
    area = 2 * cells.half_across_m[:, None]
    part = (2 * cells.half_turn_rad / shape.turn_rad if shape.turn_rad else 1.0) * 2 * cells.half_size
    return cells, np.asarray(log_weights + np.log(area * part), dtype=np.float64), sharp / number


def _size_m(shape: Shape, share: float) -> float:
    return 0.0 if shape.apart_m is None else share * (shape.apart_m[1] - shape.apart_m[0])


def _cast(window: Windows, cells: _Cells, shapes: Profile) -> Floats:
    """The range (C, K, B) at which each beam meets the shape in each cell, inf where it passes."""
    ahead, left = window.directions[:, None, :, 0], window.directions[:, None, :, 1]
    x, y = cells.away_m[..., None], cells.across_m[..., None]
    sizes, turns, offsets = shapes.depths_m.shape
    offset = window.offset_m[:, None, :] + ahead * y - left * x
    place = np.clip(offset * np.float32(1 / shapes.step_m) + np.float32(offsets // 2 + 0.5), 0, offsets - 1)
    index = place.astype(np.int32)
    if turns > 1:
        turn = (window.headings_rad[:, None, :] - cells.turn_rad[..., None]) * np.float32(turns / (2 * np.pi))
        index += np.mod(np.floor(turn + np.float32(0.5)).astype(np.int32), turns) * offsets
    if sizes > 1:
        size = np.clip((cells.size * sizes).astype(np.int32), 0, sizes - 1)
        index += (size * (turns * offsets))[..., None]
    predicted: Floats = shapes.depths_m.ravel().take(index)
    predicted += window.abreast_m[:, None, :] + ahead * x + left * y
    return predicted


def _shares(log_weights: Array) -> Array:
    weight = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    share: Array = weight / weight.sum(axis=1, keepdims=True)
    return share


def _keep(
    found: Centres, rows: NDArray[np.intp], window: Windows, cells: _Cells, log_weights: Array, variance: Array
) -> None:
    """Write the moments of what is known of some clusters."""
    share = _shares(log_weights)
    local = np.stack([cells.away_m, cells.across_m], axis=-1).astype(np.float64)
    mean = (share[..., None] * local).sum(axis=1)
    apart = local - mean[:, None]
    spread = np.einsum("ck,cki,ckj->cij", share, apart, apart)
    spread[:, 0, 0] += (share * variance).sum(axis=1) + _SURFACE_M**2
    spread[:, 1, 1] += np.square(cells.half_across_m) / 3 + _SURFACE_M**2
    turned = rotation(window.bearings_rad)
    found.positions_xy[rows] = window.in_base(mean)
    found.covariances[rows] = turned @ spread @ np.swapaxes(turned, 1, 2)
    top = log_weights.max(axis=1)
    found.log_evidence[rows] = top + np.log(np.exp(log_weights - top[:, None]).sum(axis=1))
