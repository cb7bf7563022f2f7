"""What one log saw, gathered for building a map: bundles with odometry, and the objects seen in them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array


@dataclass(frozen=True, slots=True, eq=False)
class LogObservations:
    """T bundles that have odometry and N objects seen in them.

    stamps_ns, log_times_ns (T,) rise; odom_from_base (T, 3), with the way_m (T,) and turned_rad (T,) up to there.
    Objects: `bundle` (N,) rises and says in which one each was seen, `classes` its most probable class, points_xy
    (N, 2) in the base frame with covariances (N, 2, 2) m^2, radii_m (N,), zero where unknown. `bundles` counts those
    without odometry too; `dropped` counts objects that cannot be landmarks, by reason.
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

    def objects_of(self, bundle: int) -> NDArray[np.int64]:
        """Rows of the objects of one bundle."""
        first, last = np.searchsorted(self.bundle, [bundle, bundle + 1])
        return np.arange(first, last)


def left_to_right(points_xy: Array) -> NDArray[np.int64]:
    """Order (N,) of points (N, 2) from left to right as seen from the origin, about their mean direction."""
    bearing = np.arctan2(points_xy[:, 1], points_xy[:, 0])
    middle = np.arctan2(np.sin(bearing).sum(), np.cos(bearing).sum())
    return np.argsort(-((bearing - middle + np.pi) % (2 * np.pi)), kind="stable")
