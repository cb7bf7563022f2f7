"""How far the values of two columns are apart, row by row."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.messages.columns import Column, Kind
from mcap_landmarks.stage import Tolerance

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]
_LONG = 8
"""Of more numbers than these only the place and values that differ the most are shown."""
_PLACES = ("position_m", "translation_m")
_ANGLES = ("theta", "angle_min", "angle_max", "_rad")


def of_rows(column: Column, rows: Rows) -> Column:
    """Some rows of a column, in their order."""
    if column.counts is None:
        return Column(column.kind, column.values[rows])
    counts = column.counts[rows]
    starts = np.concatenate([[0], np.cumsum(column.counts)[:-1]]).astype(np.int64) if len(column.counts) else rows
    return Column(column.kind, column.values[spans(starts[rows], counts)], counts)


def spans(starts: Rows, counts: Rows) -> Rows:
    """The whole numbers of several spans, one after the other."""
    before = np.cumsum(counts) - counts
    return np.repeat(starts - before, counts) + np.arange(int(counts.sum()), dtype=np.int64)


def difference(name: str, baseline: Column, candidate: Column, tolerance: Tolerance) -> tuple[Array, Flags]:
    """The largest difference of each row (N,), and whether one of the row's is beyond the tolerance.

    Infinite where texts or lengths differ, or where one value is not finite and the other another. NaN equals NaN,
    angles wrap, places are a distance apart, and quaternions the angle between their rotations, in radians.
    """
    a, b = baseline.counts, candidate.counts
    if a is None or b is None:
        apart, beyond = _elements(name, baseline, candidate, tolerance)
        return apart.max(axis=1, initial=0.0), np.logical_or.reduce(beyond, axis=1)
    alike = a == b
    rows = np.flatnonzero(alike)
    mine, theirs = of_rows(baseline, rows), of_rows(candidate, rows)
    apart, beyond = _elements(name, mine, theirs, tolerance)
    row_of = np.repeat(rows, a[rows])
    largest = np.where(alike, 0.0, np.inf)
    np.maximum.at(largest, row_of, apart.max(axis=1, initial=0.0))
    changed = np.logical_not(alike)
    changed[row_of[beyond.any(axis=1)]] = True
    return largest, changed


def _elements(name: str, baseline: Column, candidate: Column, tolerance: Tolerance) -> tuple[Array, Flags]:
    """Differences (N, k) of the values (N, k) of both, and which are beyond the tolerance."""
    kind, a, b = baseline.kind, baseline.values, candidate.values
    if kind is Kind.TEXT or a.shape[1] != b.shape[1]:
        differs = np.not_equal(a, b).astype(np.bool_) if a.shape == b.shape else np.ones((len(a), 1), dtype=np.bool_)
        return np.where(differs, np.inf, 0.0), differs
    if kind is Kind.QUATERNION:
        apart = _rotation(a, b)[:, None]
        return apart, apart > tolerance.absolute
    with np.errstate(invalid="ignore", over="ignore"):
        equal = (a == b) | ((a != a) & (b != b))  # noqa: PLR0124 - only NaN differs from itself
        apart = np.where(a > b, a - b, b - a).astype(np.float64)  # unsigned numbers stay above zero
        if name.endswith(_ANGLES):
            apart = np.abs(wrap(apart))
        apart = np.where(equal, 0.0, np.where(np.isnan(apart), np.inf, apart))
        size = np.maximum(np.abs(a.astype(np.float64)), np.abs(b.astype(np.float64)))
        if name.endswith(_PLACES):
            apart, size = (np.linalg.norm(values, axis=1)[:, None] for values in (apart, size))
        limit = tolerance.absolute + tolerance.relative * np.where(np.isfinite(size), size, 0.0)
    return apart, apart > limit


def _rotation(a: Array, b: Array) -> Array:
    """Angle (N,) between the rotations of quaternions (N, 4): `q` and `-q` are the same; all zero is no rotation."""
    with np.errstate(invalid="ignore", divide="ignore"):
        mine, theirs = a / np.linalg.norm(a, axis=1)[:, None], b / np.linalg.norm(b, axis=1)[:, None]
        chord = np.minimum(np.linalg.norm(mine - theirs, axis=1), np.linalg.norm(mine + theirs, axis=1))
        angle = 4 * np.arcsin(np.clip(chord / 2, 0, 1))
    equal = ((a == b) | (np.isnan(a) & np.isnan(b))).all(axis=1)
    return np.where(equal, 0.0, np.where(np.isnan(angle), np.inf, angle))


def shown(column: Column, row: int) -> object:
    """The value of one row: a number or text, or a list of them; of a long list its length."""
    values = [_plain(part) for part in _row(column, row)]
    found = values[0] if column.counts is None else values
    return f"{len(found)} values" if isinstance(found, list) and len(found) > _LONG else found


def largest_at(baseline: Column, candidate: Column, row: int) -> tuple[str, object, object]:
    """Values of both sides to show for a row: whole, or of many numbers the place and values that differ the most."""
    mine, theirs = _row(baseline, row).reshape(-1), _row(candidate, row).reshape(-1)
    if baseline.kind is Kind.TEXT or len(mine) != len(theirs) or len(mine) <= _LONG:
        return "", shown(baseline, row), shown(candidate, row)
    same = (mine == theirs) | ((mine != mine) & (theirs != theirs))  # noqa: PLR0124 - only NaN differs from itself
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where(same, 0.0, np.abs(mine.astype(np.float64) - theirs.astype(np.float64)))
    place = int(np.argmax(np.nan_to_num(apart, nan=np.inf)))
    return f"[{place}]", mine[place].item(), theirs[place].item()


def _row(column: Column, row: int) -> NDArray[np.generic]:
    if column.counts is None:
        return column.values[row : row + 1]
    start = int(column.counts[:row].sum())
    return column.values[start : start + int(column.counts[row])]


def _plain(values: NDArray[np.generic]) -> object:
    items = [item.decode(errors="replace") if isinstance(item, bytes) else item for item in values.tolist()]
    return items[0] if len(items) == 1 else items
