"""Where tracks have been, in the cells of a grid, so that those near a place are found without asking all of them."""

import itertools
import math
from collections.abc import Iterator

from mcap_landmarks.geometry.se2 import Array

Cell = tuple[int, int]


class PlaceGrid:
    """The names of what was in each cell of a plane: a spatial hash (Teschner et al. 2003)."""

    def __init__(self, cell_m: float) -> None:
        self._cell_m = cell_m
        self._names: dict[Cell, set[str]] = {}
        self._cells: dict[str, set[Cell]] = {}

    def add(self, name: str, place_xy: Array) -> None:
        """Something was at a place (2,)."""
        cell = self._index(place_xy[0]), self._index(place_xy[1])
        self._names.setdefault(cell, set()).add(name)
        self._cells.setdefault(name, set()).add(cell)

    def remove(self, name: str) -> None:
        """Something is nowhere any more."""
        for cell in self._cells.pop(name, ()):
            self._names[cell].remove(name)
            if not self._names[cell]:
                del self._names[cell]

    def rename(self, name: str, new: str) -> None:
        """What one was, another one is now, beside what that was before."""
        cells = self._cells.get(name, set()).copy()
        self.remove(name)
        self._cells.setdefault(new, set()).update(cells)
        for cell in cells:
            self._names.setdefault(cell, set()).add(new)

    def near(self, centre_xy: Array, radius_m: float) -> set[str]:
        """What was ever within a radius of a place (2,), and some of what was a little farther off."""
        return set().union(*(self._names[cell] for cell in self._overlapping(centre_xy, radius_m)))

    def _overlapping(self, centre_xy: Array, radius_m: float) -> Iterator[Cell]:
        """The cells that have something and overlap the square around a circle."""
        if (2 * radius_m / self._cell_m) ** 2 >= len(self._names):
            yield from self._names
            return
        columns, rows = (range(self._index(at - radius_m), self._index(at + radius_m) + 1) for at in centre_xy)
        yield from (cell for cell in itertools.product(columns, rows) if cell in self._names)

    def _index(self, along_m: float) -> int:
        return math.floor(along_m / self._cell_m)
