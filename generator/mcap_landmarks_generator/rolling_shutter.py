"""A rolling shutter: from where each row of an image is taken while the camera moves and turns."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.camera import Viewpoint

Floats = NDArray[np.float64]

_BAND_M = 0.005
"""The camera moves so far, at most, within the rows that are drawn from one place: half of it is a pixel at 1.3 m with
a focal length of 530 pixels."""
_MOST_BANDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Rows [first, end) of an image that are drawn from one view; `rows_turned` (end - first, 3, 3) is the rotation of
    each row's own optical frame into that of the view."""

    first: int
    end: int
    view: Viewpoint
    rows_turned: Floats


def bands(readout: Sequence[Viewpoint], rows: int) -> list[Band]:
    """The bands of an image of so many rows; `readout` are views evenly spaced from the first row's time to the last's.

    Within a band rows differ by their rotation only, which needs no distances; the way of the camera within a band is
    left out, and so is that of whatever moves.
    """
    moved_m = float(np.linalg.norm(readout[-1].eye_m - readout[0].eye_m))
    count = min(_MOST_BANDS, max(1, int(np.ceil(moved_m / _BAND_M))))
    edges = np.linspace(0, rows, count + 1).round().astype(int)
    turns = _rotations(readout, np.arange(rows) / max(rows - 1, 1))
    return [_band(readout, first, end, rows, turns) for first, end in pairwise(edges.tolist())]


def _band(readout: Sequence[Viewpoint], first: int, end: int, rows: int, turns: Floats) -> Band:
    middle = (first + end - 1) / 2 / max(rows - 1, 1)
    turn = _rotations(readout, np.array([middle]))[0]
    place = middle * (len(readout) - 1)
    steps = np.arange(len(readout))
    eye = np.array([np.interp(place, steps, axis) for axis in np.transpose([view.eye_m for view in readout])])
    time_s = float(np.interp(place, steps, [view.time_s for view in readout]))
    return Band(first, end, Viewpoint(eye, turn, time_s), turn.T @ turns[first:end])


def _rotations(readout: Sequence[Viewpoint], shares: Floats) -> Floats:
    """Rotations (N, 3, 3) world from optical at shares (N,) of the readout, between two of its views.

    They lie a step of physics apart and turn by hundredths of a degree: the chord is as good as the arc.
    """
    place = shares * (len(readout) - 1)
    before = np.minimum(place.astype(int), max(len(readout) - 2, 0))
    after = np.minimum(before + 1, len(readout) - 1)
    turns = np.array([view.world_from_optical for view in readout])
    mixed = turns[before] + (turns[after] - turns[before]) * (place - before)[:, None, None]
    left, _, right = np.linalg.svd(mixed)
    return np.asarray(left @ right)
