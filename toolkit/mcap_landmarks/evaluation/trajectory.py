"""Trajectories, and which pose of one belongs to which of another in time."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array, interpolate

Indices = NDArray[np.int64]
VARIANCES = ("var_x_m2", "cov_xy_m2", "cov_x_heading_m_rad", "var_y_m2", "cov_y_heading_m_rad", "var_heading_rad2")
"""The upper triangle of a pose's covariance, row by row."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """N poses x, y, heading (N, 3) at times (N,), with covariances (N, 3, 3) that are NaN where unknown."""

    time_ns: Indices
    poses: Array
    covariances: Array

    def __len__(self) -> int:
        return len(self.time_ns)

    @classmethod
    def of(cls, time_ns: Indices, poses: Array, covariances: Array | None = None) -> "Trajectory":
        """Sort by time; of several poses at one time the first stays."""
        stamps, first = np.unique(np.asarray(time_ns, dtype=np.int64), return_index=True)
        spread = np.full((len(time_ns), 3, 3), np.nan) if covariances is None else covariances
        return cls(stamps, np.asarray(poses, dtype=np.float64).reshape(-1, 3)[first], spread[first])


class PosePairs(NamedTuple):
    """K poses of an estimate, by index (K,), and the reference's poses (K, 3) that belong to them."""

    estimate: Indices
    reference: Array


def interpolated(estimate: Trajectory, reference: Trajectory, max_gap_ns: int) -> PosePairs:
    """Pair estimates with the reference interpolated on SE(2) at their times.

    Nothing is extrapolated, and no gap of the reference longer than `max_gap_ns` is bridged.
    """
    at, known = estimate.time_ns, reference.time_ns
    right = np.searchsorted(known, at, side="left")
    exact = np.zeros(len(at), dtype=np.bool_)
    exact[right < len(known)] = known[right[right < len(known)]] == at[right < len(known)]
    inside = (right > 0) & (right < len(known))
    inside[inside] = known[right[inside]] - known[right[inside] - 1] <= max_gap_ns
    poses = np.full((len(at), 3), np.nan)
    poses[inside] = interpolate(known, reference.poses, at[inside]) if inside.any() else poses[inside]
    poses[exact] = reference.poses[right[exact]]
    found = np.flatnonzero(inside | exact)
    return PosePairs(found, poses[found])


def nearest(estimate: Trajectory, reference: Trajectory, max_difference_ns: int) -> PosePairs:
    """Pair each pose of the shorter trajectory with the other's nearest in time, as evo does (1.38).

    Of two equally near ones the earlier is taken; one pose may be the nearest of several. Times are compared as float
    seconds, as evo reads them: among stamps since 1970 that decides, by the last 0.2 us, what lies right on the limit.
    """
    if len(estimate) > len(reference):
        asked, found = _nearest(reference.time_ns, estimate.time_ns, max_difference_ns)
        return PosePairs(found, reference.poses[asked])
    asked, found = _nearest(estimate.time_ns, reference.time_ns, max_difference_ns)
    return PosePairs(asked, reference.poses[found])


def _nearest(short_ns: Indices, long_ns: Indices, max_difference_ns: int) -> tuple[Indices, Indices]:
    if not len(long_ns):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    short_s, long_s = _seconds(short_ns), _seconds(long_ns)
    later = np.clip(np.searchsorted(long_s, short_s, side="right"), 0, len(long_s) - 1)
    earlier = np.clip(later - 1, 0, None)
    ahead = long_s[later] - short_s
    behind = np.where(later > 0, short_s - long_s[earlier], np.inf)
    best, difference = np.where(ahead < behind, later, earlier), np.minimum(ahead, behind)
    limit_s = max_difference_ns / 1e9
    inside = (short_s >= long_s[0] - limit_s) & (short_s <= long_s[-1] + limit_s)
    near = np.flatnonzero(inside & (difference <= limit_s))
    return near, best[near]


def _seconds(time_ns: Indices) -> Array:
    seconds: Array = time_ns // 10**9 + (time_ns % 10**9) * 1e-9
    return seconds
