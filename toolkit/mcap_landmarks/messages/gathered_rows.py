"""Rows of many tables as those of one, in any order."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.messages.columns import Column, Table

Indices = NDArray[np.int64]
_MOST_ROOM = 1 << 28
"""Bytes of a column that room is made for before there are so many: what a file says of its counts may be wrong."""


class Gathered:
    """The rows of tables of the same columns, copied one after the other to where there is room for those expected.

    `empty` is a table of these columns. Joining tables in the end instead takes four times as long.
    """

    def __init__(self, empty: Table, expected: int = 0) -> None:
        self._empty, self._expected, self._rows = empty, expected, 0
        self._values = {name: Room() for name in empty.columns}
        self._counts = {name: Room() for name, column in empty.columns.items() if column.counts is not None}

    def add(self, table: Table) -> None:
        """Take the rows of a table."""
        if not table.rows:
            return
        self._rows += table.rows
        for name, column in table.columns.items():
            values = column.values
            count = len(values) if values.ndim < 3 else len(values) * values.shape[1]
            self._values[name].add(values, count * self._expected // table.rows)
            if column.counts is not None:
                self._counts[name].add(column.counts, self._expected)

    def table(self) -> Table:
        """All rows."""
        if not self._rows:
            return self._empty
        columns = {}
        for name, column in self._empty.columns.items():
            counts = self._counts[name].filled if name in self._counts else None
            columns[name] = Column(column.kind, self._values[name].filled, counts)
        return Table(self._rows, columns, {})


class Room:
    """Arrays one after the other, in one with room for more."""

    def __init__(self) -> None:
        self._array: NDArray[Any] = np.zeros(0)
        self._used = 0

    @property
    def filled(self) -> NDArray[Any]:
        """What was added."""
        return self._array[: self._used]

    def add(self, values: NDArray[Any], expected: int) -> None:
        """Take the next values; so many are expected in all, which is told by those who may be wrong.

        Those of rows that have as many each may come as (N, count, k).
        """
        shape = values.shape if values.ndim < 3 else (len(values) * values.shape[1], values.shape[2])
        end = self._used + shape[0]
        if not self._used or end > len(self._array):
            most = _MOST_ROOM // max(values.dtype.itemsize * prod(shape[1:]), 1)
            grown = np.empty((max(2 * self._used, end, min(expected, most)), *shape[1:]), values.dtype)
            if self._used:
                grown[: self._used] = self.filled
            self._array = grown
        self._array[self._used : end].reshape(values.shape)[...] = values
        self._used = end


def in_order(table: Table, order: Indices) -> Table:
    """The rows of a table in another order, or some of them."""
    if len(order) == table.rows and (np.diff(order) > 0).all():
        return table
    return Table(len(order), {name: _in_order(column, order) for name, column in table.columns.items()}, {})


def _in_order(column: Column, order: Indices) -> Column:
    if column.counts is None:
        return Column(column.kind, column.values[order])
    first, counts = (np.cumsum(column.counts) - column.counts)[order], column.counts[order]
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return Column(column.kind, column.values[np.repeat(first, counts) + within], counts)
