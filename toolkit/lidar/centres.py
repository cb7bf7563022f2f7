"""Where the centre of an object of known shape is, from its hits and from the beams that pass it by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array, rotation
from toolkit.lidar.cells import SURFACE_M, Cells, Noise, finer, first_cells, sharp, weigh
from toolkit.lidar.palette import Palette, palette
from toolkit.lidar.shapes import Shape
from toolkit.lidar.windows import Windows

_ENOUGH, _MANY = 5.0, 12.0
"""A posterior that spreads over so many cells of the grid is fine enough, over many even where these are coarse."""
_BLURRED = 8.0
"""A grid is too coarse where its cells add so much more to the variance of a hit."""
_LEVELS = 3
_HOPELESS = 12.0
"""A shape whose evidence is lower than another's by this logarithm needs no better place."""
_EDGE_M = 0.03
"""How much wider than its shape noise can make an object look."""


@dataclass(frozen=True, slots=True, eq=False)
class Centres:
    """Of C clusters under S shapes: log_evidence (C, S), -inf where it cannot be; positions_xy (C, S, 2), covariances
    (C, S, 2, 2) in m^2, both in the base frame and meaningless where the evidence is -inf.

    The evidence is the density of the hits' ranges times the area in m^2 that the centre could lie in.
    """

    log_evidence: Array
    positions_xy: Array
    covariances: Array


def centres(
    window: Windows, shapes: Sequence[Shape], noise: Noise, allowed: NDArray[np.bool_] | None = None
) -> Centres:
    """The posteriors of the centre over position, turn and size, of each shape, all equally likely before.

    Position across the view, turn and size are integrated over a grid that is refined where the posterior lies; the
    position along the view follows from the hits in closed form. What explains a cluster far worse than another shape
    does is not refined. `allowed` (C, S) says which shapes come into question, if not all.
    """
    known, many = palette(shapes), (len(window), len(shapes))
    found = Centres(
        np.full(many, -np.inf),
        np.repeat(window.anchors_xy[:, None], many[1], axis=1),
        np.broadcast_to(np.eye(2), (*many, 2, 2)).copy(),
    )
    clusters, which = np.nonzero(_possible(window, known) & (True if allowed is None else allowed))
    is_round, has_sizes = known.turn_rad[which] == 0, known.span_m[which] > 0
    alike = [np.flatnonzero(rows) for rows in (is_round, has_sizes, ~is_round & ~has_sizes)]
    searches = [_Search(window, known, clusters[rows], which[rows], noise, found) for rows in alike if len(rows)]
    surely = found.log_evidence.max(axis=1, initial=-np.inf)
    for search in searches:
        search.refine(surely - _HOPELESS)
    return found


def _possible(window: Windows, shapes: Palette) -> NDArray[np.bool_]:
    """Whether clusters (C, S) are no wider than the shapes, and no narrower where beams pass them on both sides."""
    width = (window.lateral_m[:, 1] - window.lateral_m[:, 0])[:, None]
    beside = (window.beside_m > 0) & (window.beside_m <= 1.5 * window.spacing_m[window.cluster])
    behind = (window.ranges_m - window.abreast_m)[beside]
    passed = np.zeros((len(window), len(shapes.reach_m)), dtype=np.int64)
    np.add.at(passed, window.cluster[beside], behind[:, None] > shapes.reach_m)
    least = shapes.least_width_m - 3 * window.spacing_m[:, None] - _EDGE_M / 2
    possible: NDArray[np.bool_] = (width <= 2 * shapes.reach_m + _EDGE_M) & ((width >= least) | (passed < 2))
    return possible


class _Search:
    """The posteriors of clusters under shapes, row by row, at first on a coarse grid."""

    def __init__(
        self,
        window: Windows,
        shapes: Palette,
        clusters: NDArray[np.intp],
        which: NDArray[np.intp],
        noise: Noise,
        found: Centres,
    ) -> None:
        self._window, self._clusters, self._which = window, clusters, which
        self._found, self._noise = found, noise
        self._shapes = shapes.rows(which)
        self._cells = first_cells(window.lateral_m[clusters], self._shapes)
        self._weigh(passes=2)

    def refine(self, least: Array) -> None:
        """Refine the grids of rows that could get their cluster's evidence of `least` (C,)."""
        blur = np.log1p(self._cells.blur_m2(self._shapes) / sharp(self._noise))
        known = self._found.log_evidence[self._clusters, self._which]
        hopeful = known + 0.5 * self._window.hits[self._clusters] * blur >= least[self._clusters]
        for _ in range(_LEVELS):
            cells = 1 / (_shares(self._log_weights) ** 2).sum(axis=1)
            blurred = self._cells.blur_m2(self._shapes) > _BLURRED * sharp(self._noise)
            again = np.flatnonzero(hopeful & (cells < np.where(blurred, _MANY, _ENOUGH)))
            if not len(again):
                return
            self._clusters, self._which = self._clusters[again], self._which[again]
            self._shapes = self._shapes.rows(again)
            self._cells = finer(self._cells, again, self._log_weights)
            self._weigh(passes=1)
            hopeful = np.ones(len(again), dtype=np.bool_)

    def _weigh(self, passes: int) -> None:
        rays = self._window.rays(self._clusters, 2 * self._shapes.reach_m)
        self._cells, self._log_weights, hits = weigh(rays, self._cells, self._shapes, self._noise, passes)
        rows = self._clusters, self._which
        _keep(
            self._found,
            rows,
            self._window,
            self._cells,
            self._log_weights,
            sharp(self._noise) / hits.astype(np.float64),
        )


def _shares(log_weights: Array) -> Array:
    weight = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    share: Array = weight / weight.sum(axis=1, keepdims=True)
    return share


def _keep(
    found: Centres,
    rows: tuple[NDArray[np.intp], NDArray[np.intp]],
    window: Windows,
    cells: Cells,
    log_weights: Array,
    variance: Array,
) -> None:
    """Write the evidence and the moments of the centre; `variance` (R, K) is that of the cells' distances."""
    top = log_weights.max(axis=1)
    weight = np.exp(log_weights - top[:, None])
    total = weight.sum(axis=1)
    share = weight / total[:, None]
    away, across = cells.away_m.astype(np.float64), cells.across_m.astype(np.float64)
    mean = np.stack([(share * away).sum(axis=1), (share * across).sum(axis=1)], axis=1)
    away, across = away - mean[:, :1], across - mean[:, 1:]
    spread = np.empty((len(mean), 2, 2))
    spread[:, 0, 0] = (share * (away**2 + variance)).sum(axis=1) + SURFACE_M**2
    spread[:, 1, 1] = (share * across**2).sum(axis=1) + np.square(cells.half_across_m) / 3 + SURFACE_M**2
    spread[:, 0, 1] = spread[:, 1, 0] = (share * away * across).sum(axis=1)
    turned = rotation(window.bearings_rad[rows[0]])
    found.positions_xy[rows] = window.in_base(rows[0], mean)
    found.covariances[rows] = turned @ spread @ np.swapaxes(turned, 1, 2)
    found.log_evidence[rows] = top + np.log(total)
