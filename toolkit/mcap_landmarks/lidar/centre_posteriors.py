"""Where the centre of an object of known shape is, from its hits and from the beams that pass it by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array, rotation
from mcap_landmarks.lidar.cells import SURFACE_M, Cells, Noise, finer, first_cells, sharp, weigh
from mcap_landmarks.lidar.shape_table import ShapeTable, shape_table
from mcap_landmarks.lidar.shapes import Shape
from mcap_landmarks.lidar.windows import Windows

_ENOUGH, _MANY = 5.0, 12.0
"""A posterior that spreads over so many cells of the grid is fine enough, over many even where these are coarse."""
_BLURRED = 4.0
"""A grid is too coarse where its cells add so much more to the variance of a hit."""
_LEVELS = 3
"""So often a grid is refined at most: each time its cells become a quarter as wide."""
_HOPELESS = 12.0
"""A shape whose evidence is lower than another's by this logarithm needs no better place."""
_LOST = 1 / 3
"""So many times as many beams as meet a thing, at most, return nothing from it."""
_EDGE_M = 0.03
"""How much wider than its shape noise can make an object look."""


@dataclass(frozen=True, slots=True, eq=False)
class CentrePosteriors:
    """Of C clusters under S shapes: log_evidence (C, S), -inf where it cannot be; positions_xy (C, S, 2), covariances
    (C, S, 2, 2) in m^2, both in the base frame and meaningless where the evidence is -inf.

    The evidence is the density of the hits' ranges times the area in m^2 that the centre could lie in.
    """

    log_evidence: Array
    positions_xy: Array
    covariances: Array


def centres(
    window: Windows, shapes: Sequence[Shape], noise: Noise, allowed: NDArray[np.bool_] | None = None
) -> CentrePosteriors:
    """The posteriors of the centre over position, turn and size, of each shape, all equally likely before.

    Position across the view, turn and size are integrated over a grid that is refined where the posterior lies; the
    position along the view follows from the hits in closed form. What explains a cluster far worse than another shape
    does is not refined. `allowed` (C, S) says which shapes come into question, if not all.
    """
    known, many = shape_table(shapes), (len(window), len(shapes))
    found = CentrePosteriors(
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


def _possible(window: Windows, shapes: ShapeTable) -> NDArray[np.bool_]:
    """Whether clusters (C, S) are no wider than the shapes, and no narrower where beams pass them on both sides.

    Nor may many beams pass between the hits, if the shapes have no holes.
    """
    width = (window.lateral_m[:, 1] - window.lateral_m[:, 0])[:, None]
    behind = (window.ranges_m - window.abreast_m)[:, None] > shapes.reach_m
    beside = (window.beside_m > 0) & (window.beside_m <= 1.5 * window.spacing_m[window.cluster])
    between = (window.beside_m == 0) & ~window.is_hit
    passed, holes = (_counts(window.cluster[rows], behind[rows], len(window)) for rows in (beside, between))
    least = shapes.least_width_m - 3 * window.spacing_m[:, None] - _EDGE_M / 2
    fits = (width >= least) | (passed < 2)
    fits &= (shapes.least_width_m == 0) | (holes <= _LOST * (window.hits[:, None] + 3))
    possible: NDArray[np.bool_] = (width <= 2 * shapes.reach_m + _EDGE_M) & fits
    return possible


def _counts(rows: NDArray[np.intp], values: NDArray[np.bool_], many: int) -> NDArray[np.int64]:
    """How many values (N, S) are true in each of so many rows."""
    counts = np.zeros((many, values.shape[1]), dtype=np.int64)
    np.add.at(counts, rows, values)
    return counts


class _Search:
    """The posteriors of clusters under shapes, row by row, at first on a coarse grid."""

    def __init__(
        self,
        window: Windows,
        shapes: ShapeTable,
        clusters: NDArray[np.intp],
        which: NDArray[np.intp],
        noise: Noise,
        found: CentrePosteriors,
    ) -> None:
        self._window, self._clusters, self._which = window, clusters, which
        self._found, self._noise = found, noise
        self._shapes = shapes.rows(which)
        self._cells = first_cells(window.lateral_m[clusters], self._shapes)
        self._weigh(passes=2)

    def refine(self, least: Array) -> None:
        """Refine the grids of rows that could get their cluster's evidence of `least` (C,)."""
        for _ in range(_LEVELS):
            blur = self._cells.blur_m2(self._shapes) / sharp(self._noise)
            known = self._found.log_evidence[self._clusters, self._which]
            hopeful = known + 0.5 * self._window.hits[self._clusters] * np.log1p(blur) >= least[self._clusters]
            cells = 1 / (self._share**2).sum(axis=1)
            again = np.flatnonzero(hopeful & (cells < np.where(blur > _BLURRED, _MANY, _ENOUGH)))
            if not len(again):
                return
            self._clusters, self._which = self._clusters[again], self._which[again]
            self._shapes = self._shapes.rows(again)
            self._cells = finer(self._cells, again, self._share)
            self._weigh(passes=1)

    def _weigh(self, passes: int) -> None:
        """Weigh the cells, and write what follows for the rows."""
        window, rows = self._window, (self._clusters, self._which)
        rays = window.rays(self._clusters, 2 * self._shapes.reach_m)
        self._cells, log_weights, hits = weigh(rays, self._cells, self._shapes, self._noise, passes)
        top = log_weights.max(axis=1, keepdims=True)
        weight = np.exp(log_weights - top)
        total = weight.sum(axis=1, keepdims=True)
        self._share = weight / total
        mean, spread = _moments(self._cells, self._share, sharp(self._noise) / hits.astype(np.float64))
        turned = rotation(window.bearings_rad[self._clusters])
        self._found.positions_xy[rows] = window.in_base(self._clusters, mean)
        self._found.covariances[rows] = turned @ spread @ np.swapaxes(turned, 1, 2)
        self._found.log_evidence[rows] = (top + np.log(total))[:, 0]


def _moments(cells: Cells, share: Array, variance: Array) -> tuple[Array, Array]:
    """Mean (R, 2) and covariance (R, 2, 2) of the centre, in the windows' frames; `variance` (R, K) is that of the
    cells' distances."""
    away, across = cells.away_m.astype(np.float64), cells.across_m.astype(np.float64)
    mean = np.stack([(share * away).sum(axis=1), (share * across).sum(axis=1)], axis=1)
    away, across = away - mean[:, :1], across - mean[:, 1:]
    spread = np.empty((len(mean), 2, 2))
    spread[:, 0, 0] = (share * (away**2 + variance)).sum(axis=1) + SURFACE_M**2
    spread[:, 1, 1] = (share * across**2).sum(axis=1) + np.square(cells.half_across_m) / 3 + SURFACE_M**2
    spread[:, 0, 1] = spread[:, 1, 0] = (share * away * across).sum(axis=1)
    return mean, spread
