"""Which bundles a page shows: all of a short log, of a long one failures first and then evenly."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.evaluation.trajectory import Indices

MOST_MARKS = 2400
"""So many markers a browser draws as SVG, and zooms, without waiting (about 0.2 s on a laptop)."""
MOST_DETAILS = 480
"""So many bundles keep their image, scan and match: with 12 KB of image and 6 KB of the rest that is 9 MB."""
MOST_POINTS = 3000
"""So many points of a path or a curve are as many as a wide screen has pixels."""


def evenly(rows: Indices, most: int) -> Indices:
    """At most so many of some rows, the first and the last among them."""
    if len(rows) <= most:
        return rows
    return rows[np.unique(np.linspace(0, len(rows) - 1, most).round().astype(np.int64))]


def failures_first(failed: NDArray[np.bool_], among: Indices, most: int) -> Indices:
    """At most so many rows out of `among`, in their order: failures take at least half of the places, if they need it.

    `failed` (N,) tells of all rows which are failures. What is more of either kind is thinned evenly.
    """
    bad, good = among[failed[among]], among[~failed[among]]
    room = max(most // 2, most - len(good))
    kept = evenly(bad, room)
    return np.sort(np.concatenate([kept, evenly(good, most - len(kept))]))
