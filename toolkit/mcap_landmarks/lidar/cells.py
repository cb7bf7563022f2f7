"""Cells of the space of positions across the view, turns and sizes of a shape, and what a scan says of each."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.shape_table import Floats, ShapeTable
from mcap_landmarks.lidar.windows import Rays

SURFACE_M = 0.002
"""How far real outlines are off their shapes."""
_KEPT = 16
"""Cells that a refinement keeps, each cut into up to 32: bounds what a level costs."""
_CLEAR_M = 0.05
"""A beam that ends no more than this behind a surface may have met it."""
_STRAY_RANGE_M = 0.5
"""Hits of something else lie anywhere within so many metres along the view: where segments end, others begin."""
_FAR_M = 1e3
"""Beyond every range: at first all hits count, however far off."""
_OUTLIER_M = 0.1
"""A hit that is so far off the outline does not say where it is."""
_BLUR = 0.6
"""The share of a cell's half widths, squared, that a prediction for its middle is off. A uniform error would have 1/3;
it is more, as the errors of place, turn and size add up where a surface slants (tuned on simulated scans)."""


@dataclass(frozen=True, slots=True)
class Noise:
    """What a LiDAR does.

    Standard deviation of its ranges, the share of beams that return nothing from an object, and the share of hits that
    come from something else.
    """

    sigma_m: float = 0.01
    dropout: float = 0.01
    stray: float = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """K cells for each of R rows, in the frames of their windows.

    Middles (R, K): away_m and across_m, the place of the centre, of which the former follows from the hits; turn_rad;
    size, 0 to 1 from the smallest to the largest. Half the size of a row's cells (R,): half_across_m, half_turn_rad,
    half_size.
    """

    away_m: Floats
    across_m: Floats
    turn_rad: Floats
    size: Floats
    half_across_m: Floats
    half_turn_rad: Floats
    half_size: Floats

    def blur_m2(self, shapes: ShapeTable) -> Array:
        """The variance (R,) of what a cell's middle predicts for all of it."""
        turn, size = self.half_turn_rad * shapes.reach_m / 2, self.half_size * shapes.span_m / 2
        blur: Array = _BLUR * (np.square(self.half_across_m, dtype=np.float64) + turn**2 + size**2)
        return blur


def first_cells(lateral_m: Array, shapes: ShapeTable) -> Cells:
    """A coarse grid of all that the outermost hits (R, 2) allow, for shapes that are all round, or of one size, or none
    of either."""
    across, turns, sizes = 8, 16, 1
    if shapes.turn_rad[0] == 0:
        across, turns = 24, 1
    elif shapes.span_m[0] > 0:
        turns, sizes = 8, 2
    x, t, s = _grid(across, turns, sizes)
    low, high = lateral_m[:, 1] - shapes.reach_m, lateral_m[:, 0] + shapes.reach_m
    low, high = np.minimum(low, high) - SURFACE_M, np.maximum(low, high) + SURFACE_M
    parts: tuple[Array, ...] = (
        np.repeat(0.7 * shapes.reach_m[:, None], len(x), axis=1),
        low[:, None] + (high - low)[:, None] * x,
        shapes.turn_rad[:, None] * t,
        np.repeat(s[None], len(low), axis=0),
        (high - low) / (2 * across),
        shapes.turn_rad / (2 * turns),
        np.full(len(low), 0.5 / sizes),
    )
    return Cells(*(part.astype(np.float32) for part in parts))


@cache
def _grid(across: int, turns: int, sizes: int) -> Array:
    """The middles (3, K) of cells of a unit cube."""
    axes = [(np.arange(count) + 0.5) / count for count in (across, turns, sizes)]
    return np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)


def finer(cells: Cells, rows: NDArray[np.intp], shares: Array) -> Cells:
    """The cells of some rows that have the largest shares (R, K), cut up: into four across and by turn, two by size."""
    best = np.argpartition(shares[rows], -_KEPT, axis=1)[:, -_KEPT:]
    turns, sizes = 4 if cells.half_turn_rad[0] > 0 else 1, 2 if cells.half_size[0] < 0.5 else 1
    x, t, s = (2 * _grid(4, turns, sizes) - 1).astype(np.float32)

    across, turn, size = cells.half_across_m[rows], cells.half_turn_rad[rows], cells.half_size[rows]

    def cut(middles: Floats, halves: Floats, places: Floats) -> Floats:
        shifts = halves[:, None, None] * places
        return (middles[rows[:, None], best][:, :, None] + shifts).reshape(len(rows), -1)

    return Cells(
        cut(cells.away_m, across, 0 * x),
        cut(cells.across_m, across, x),
        cut(cells.turn_rad, turn, t),
        cut(cells.size, size, s),
        across / np.float32(4),
        turn / np.float32(turns),
        size / np.float32(sizes),
    )


def sharp(noise: Noise) -> float:
    """The variance of a hit about the outline."""
    return noise.sigma_m**2 + SURFACE_M**2


def weigh(
    rays: tuple[Rays, Rays], cells: Cells, shapes: ShapeTable, noise: Noise, passes: int
) -> tuple[Cells, Array, Floats]:
    """The cells at their best distances, the logarithm of their weights, and how many hits these rest on (R, K).

    `rays` are the hits, and the beams that pass. A hit counts by how much its range changes with that distance: one
    along the view fully, one across it not at all. Every pass but the last moves the cells to where their hits are; the
    last one settles what remains.
    """
    (hits, others), rows = rays, len(cells.across_m)
    fine, blur = sharp(noise), cells.blur_m2(shapes)
    variance = (fine + blur).astype(np.float32)[hits.row, None]
    stray = 2 * np.float32(np.log(_STRAY_RANGE_M / noise.stray)) - np.log(np.float32(2 * np.pi) * variance)
    for left in reversed(range(passes)):
        off = hits.ranges_m - _cast(hits, cells, shapes)
        used = (np.abs(off) < (_FAR_M if left else _OUTLIER_M)).astype(np.float32)
        used *= hits.ahead
        number = hits.sums(used * hits.ahead, rows).clip(np.float32(1e-3))
        shift: Floats = hits.sums(used * off, rows) / number
        cells = replace(cells, away_m=cells.away_m + shift)
    off -= shift[hits.row] * hits.ahead
    off *= off
    off /= variance
    squared = hits.sums(np.minimum(off, stray, out=off), rows)
    met = _cast(others, cells, shapes) < others.ranges_m - np.float32(_CLEAR_M)
    missed = others.sums(met.astype(np.float32), rows)
    count = np.bincount(hits.row)[:, None]
    log_weights = np.log(noise.dropout) * np.sqrt(fine / (fine + blur))[:, None] * missed - 0.5 * squared
    log_weights += 0.5 * (1 - count) * np.log(2 * np.pi * (fine + blur))[:, None] - 0.5 * np.log(number)
    turn = np.where(shapes.turn_rad > 0, 2 * cells.half_turn_rad / np.maximum(shapes.turn_rad, 1e-9), 1.0)
    log_weights += np.log(2 * cells.half_across_m * turn * 2 * cells.half_size)[:, None]
    return cells, log_weights, number


def _cast(rays: Rays, cells: Cells, shapes: ShapeTable) -> Floats:
    """The range (P, K) at which each beam meets the shape in each cell of its row, very far where it passes."""
    x, y = cells.away_m[rays.row], cells.across_m[rays.row]
    offset = rays.ahead * y
    offset -= rays.left * x
    offset += rays.offset_m
    predicted = shapes.look_up((rays.row, rays.headings_rad, offset), cells.turn_rad, cells.size)
    x *= rays.ahead
    y *= rays.left
    predicted += x
    predicted += y
    predicted += rays.abreast_m
    return predicted
