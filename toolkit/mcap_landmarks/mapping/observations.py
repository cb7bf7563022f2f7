"""What one log saw, gathered for building a map: bundles with odometry, and the objects seen in them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array


@dataclass(frozen=True, slots=True, eq=False)
class LogObservations:
    """T bundles that have odometry and N objects seen in them.

    stamps_ns, log_times_ns (T,) rise; odom_from_base (T, 3), with the way_m (T,) and turned_rad (T,) up to there.
    Objects: `bundle` (N,) rises and says in which one each was seen, `classes` its most probable class, points_xy
    (N, 2) in the base frame with covariances (N, 2, 2) m^2, radii_m (N,), zero where unknown. `bundles` counts those
    without odometry too; `dropped` counts objects that cannot be landmarks, by reason. Between bundles of another
    `piece` (T,), which rises, odometry tells nothing; empty where all are of one.
    """

    stamps_ns: NDArray[np.int64]
    log_times_ns: NDArray[np.int64]
    odom_from_base: Array
    way_m: Array
    turned_rad: Array
    bundle: NDArray[np.int64]
    classes: tuple[str, ...]
    points_xy: Array
    covariances: Array
    radii_m: Array
    bundles: int
    fingerprint: str = ""
    dropped: Mapping[str, int] = field(default_factory=dict)
    piece: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def pieces(self) -> "list[LogObservations]":
        """What each piece saw, the one with most objects first; those without any are left out, unless all are."""
        cuts = [0, *(np.flatnonzero(np.diff(self.piece)) + 1).tolist(), len(self.stamps_ns)]
        if len(cuts) == 2:
            return [self]
        parts = [self._between(first, end) for first, end in pairwise(cuts)]
        parts.sort(key=lambda part: -len(part.bundle))
        seen = [part for part in parts if len(part.bundle)] or parts[:1]
        return [replace(seen[0], bundles=self.bundles, dropped=self.dropped), *seen[1:]]

    def _between(self, first: int, end: int) -> "LogObservations":
        rows = slice(*np.searchsorted(self.bundle, [first, end]).tolist())
        return LogObservations(
            self.stamps_ns[first:end],
            self.log_times_ns[first:end],
            self.odom_from_base[first:end],
            self.way_m[first:end],
            self.turned_rad[first:end],
            self.bundle[rows] - first,
            self.classes[rows],
            self.points_xy[rows],
            self.covariances[rows],
            self.radii_m[rows],
            0,
            self.fingerprint,
        )

    def objects_of(self, bundle: int) -> NDArray[np.int64]:
        """Rows of the objects of one bundle."""
        first, last = np.searchsorted(self.bundle, [bundle, bundle + 1])
        return np.arange(first, last)


def left_to_right(points_xy: Array) -> NDArray[np.int64]:
    """Order (N,) of points (N, 2) from left to right as seen from the origin, about their mean direction."""
    bearing = np.arctan2(points_xy[:, 1], points_xy[:, 0])
    middle = np.arctan2(np.sin(bearing).sum(), np.cos(bearing).sum())
    return np.argsort(-((bearing - middle + np.pi) % (2 * np.pi)), kind="stable")
