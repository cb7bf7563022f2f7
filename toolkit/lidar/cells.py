"""Cells of the space of positions across the view, turns and sizes of a shape, and what a scan says of each."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array
from toolkit.lidar.palette import Floats, Palette
from toolkit.lidar.windows import Windows

SURFACE_M = 0.002
"""How far real outlines are off their shapes."""
_KEPT = 16
_CLEAR_M = 0.05
"""A beam that ends no more than this behind a surface may have met it."""
_STRAY_RANGE_M = 0.5
_OUTLIER_M = 0.1
"""A hit that is so far off the outline does not say where it is."""
_BLUR = 0.6
"""The share of a cell's half widths, squared, that a prediction for its middle is off."""


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

    def blur_m2(self, shapes: Palette) -> Array:
        """The variance (R,) of what a cell's middle predicts for all of it."""
        turn, size = self.half_turn_rad * shapes.reach_m / 2, self.half_size * shapes.span_m / 2
        blur: Array = _BLUR * (np.square(self.half_across_m, dtype=np.float64) + turn**2 + size**2)
        return blur


def first_cells(window: Windows, shapes: Palette) -> Cells:
    """A coarse grid of all that the outermost hits allow; either all shapes are round or none."""
    is_round, sized = bool((shapes.turn_rad == 0).all()), shapes.span_m > 0
    fixed = _grid(24, 1, 1) if is_round else _grid(8, 16, 1)
    x, t, s = np.where(sized[:, None, None], _grid(8, 8, 2) if sized.any() else fixed, fixed).swapaxes(0, 1)
    low, high = window.lateral_m[:, 1] - shapes.reach_m, window.lateral_m[:, 0] + shapes.reach_m
    low, high = np.minimum(low, high) - SURFACE_M, np.maximum(low, high) + SURFACE_M
    half_turn = shapes.turn_rad / (2 if is_round else np.where(sized, 16, 32))
    parts: tuple[Array, ...] = (
        np.broadcast_to(0.7 * shapes.reach_m[:, None], x.shape),
        low[:, None] + (high - low)[:, None] * x,
        shapes.turn_rad[:, None] * t,
        s,
        (high - low) / (48 if is_round else 16),
        half_turn,
        np.where(sized, 0.25, 0.5),
    )
    return Cells(*(part.astype(np.float32) for part in parts))


def _grid(across: int, turns: int, sizes: int) -> Array:
    """The middles (3, K) of cells of a unit cube."""
    axes = [(np.arange(count) + 0.5) / count for count in (across, turns, sizes)]
    return np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)


def finer(cells: Cells, rows: NDArray[np.intp], log_weights: Array) -> Cells:
    """The best cells of some rows, each cut up: into four across and by turn, into two by size."""
    best = np.argpartition(-log_weights[rows], _KEPT - 1, axis=1)[:, :_KEPT]
    is_round, sized = bool((cells.half_turn_rad == 0).all()), bool((cells.half_size < 0.5).any())
    x, t, s = (2 * _grid(4, 1 if is_round else 4, 2 if sized else 1) - 1).astype(np.float32)

    def cut(middles: Floats, halves: Floats, shift: Floats) -> Floats:
        chosen = middles[rows[:, None], best][:, :, None]
        return (chosen + halves[rows, None, None] * shift).reshape(len(rows), -1)

    size = np.where(cells.half_size < 0.5, cells.half_size, np.float32(0))
    return Cells(
        cut(cells.away_m, size, np.zeros_like(s)),
        cut(cells.across_m, cells.half_across_m, x),
        cut(cells.turn_rad, cells.half_turn_rad, t),
        cut(cells.size, size, s),
        (cells.half_across_m[rows] / 4).astype(np.float32),
        (cells.half_turn_rad[rows] / 4).astype(np.float32),
        np.where(cells.half_size < 0.5, cells.half_size / 2, cells.half_size)[rows] if sized else cells.half_size[rows],
    )


def sharp(noise: Noise) -> float:
    """The variance of a hit about the outline."""
    return noise.sigma_m**2 + SURFACE_M**2


def weigh(window: Windows, cells: Cells, shapes: Palette, noise: Noise, passes: int) -> tuple[Cells, Array, Floats]:
    """The cells at their best distances, the logarithm of their weights, and how many hits these rest on (R, K).

    A hit counts by how much its range changes with that distance: one along the view fully, one across it not at all.

    Every pass but the last moves the cells to where their hits are; the last one settles what remains.
    """
    fine, blur = sharp(noise), cells.blur_m2(shapes)
    variance = (fine + blur).astype(np.float32)[:, None, None]
    stray = 2 * np.float32(np.log(_STRAY_RANGE_M / noise.stray)) - np.log(np.float32(2 * np.pi) * variance)
    hit, ranges, along = window.is_hit[:, None, :], window.ranges_m[:, None, :], window.directions[:, None, :, 0]
    for left in reversed(range(passes)):
        predicted = _cast(window, cells, shapes)
        off = np.where(hit, ranges - predicted, np.float32(-np.inf))
        used = np.abs(off) < (np.inf if left else _OUTLIER_M)
        number = np.maximum((used * along**2).sum(axis=2), np.float32(1e-3))
        shift = (np.where(used, off, np.float32(0)) * along).sum(axis=2) / number
        cells = replace(cells, away_m=cells.away_m + shift)
    moved = shift[..., None] * along
    squared = np.where(hit, np.minimum((off - moved) ** 2 / variance, stray), np.float32(0)).sum(axis=2)
    missed = ((predicted + moved < ranges - np.float32(_CLEAR_M)) & ~hit).sum(axis=2)
    hits = window.is_hit.sum(axis=1)[:, None]
    log_weights = np.log(noise.dropout) * np.sqrt(fine / (fine + blur))[:, None] * missed - 0.5 * squared
    log_weights += 0.5 * (1 - hits) * np.log(2 * np.pi * (fine + blur))[:, None] - 0.5 * np.log(number)
    turn = np.where(shapes.turn_rad > 0, 2 * cells.half_turn_rad / np.maximum(shapes.turn_rad, 1e-9), 1.0)
    log_weights += np.log(2 * cells.half_across_m * turn * 2 * cells.half_size)[:, None]
    return cells, log_weights, number


def _cast(window: Windows, cells: Cells, shapes: Palette) -> Floats:
    """The range (R, K, B) at which each beam meets the shape in each cell, inf where it passes."""
    ahead, left = window.directions[:, None, :, 0], window.directions[:, None, :, 1]
    x, y = cells.away_m[..., None], cells.across_m[..., None]
    offset = ahead * y
    offset -= left * x
    offset += window.offset_m[:, None, :]
    heading = window.headings_rad[:, None, :] - cells.turn_rad[..., None]
    predicted = shapes.look_up(heading, offset, cells.size)
    predicted += ahead * x
    predicted += left * y
    predicted += window.abreast_m[:, None, :]
    return predicted
