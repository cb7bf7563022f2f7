"""What a map builder hands back: the map, where each robot drove, and how the solver ended."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.model import LandmarkMap


@dataclass(frozen=True, slots=True, eq=False)
class LogTrajectory:
    """Where a log's robot was: stamps and log times (T,), map_from_base (T, 3)."""

    stamps_ns: NDArray[np.int64]
    log_times_ns: NDArray[np.int64]
    map_from_base: Array


class BuiltMap(NamedTuple):
    """A map, one trajectory in it per log, and how the solver ended; None where the method has none.

    `left_out` counts per log the bundles that could not be laid on the rest. `excluded` says by its row why a log is no
    part of the map; that has no trajectory.
    """

    landmark_map: LandmarkMap
    trajectories: Sequence[LogTrajectory | None]
    termination: Termination | None
    left_out: tuple[int, ...] = ()
    excluded: Mapping[int, str] = {}
