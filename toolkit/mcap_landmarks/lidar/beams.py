"""Beams of one or more planar LiDARs as rays in the base frame, at one moment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, compose

_SEAM = 2.5
"""Beams that are so many times farther apart than most have something between them that nobody looked at."""
_AT_LIMIT_M = 1e-3
"""A range so near to the upper limit says that there was no echo: drivers round to float32."""


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """N rays in the base frame, counter-clockwise per sweep: a sweep is one turn of one LiDAR.

    origins_xy, directions_xy (N, 2), the latter of unit length; angles_rad (N,) theirs; ranges_m (N,), inf where a beam
    met nothing. starts: where each sweep begins, and at last N. spacing_rad and is_closed per sweep: the usual angle
    between neighbours, and whether the last beam is the first one's neighbour.
    """

    origins_xy: Array
    directions_xy: Array
    angles_rad: Array
    ranges_m: Array
    starts: tuple[int, ...]
    spacing_rad: tuple[float, ...]
    is_closed: tuple[bool, ...]

    def points_at(self, beams: NDArray[np.int64]) -> Array:
        """Where some beams (N,) ended (N, 2); not finite where they met nothing."""
        with np.errstate(invalid="ignore"):
            points: Array = self.origins_xy[beams] + self.ranges_m[beams, None] * self.directions_xy[beams]
        return points


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """What is looked at: ranges in m from the LiDAR, bearings in rad in the base frame, counter-clockwise from, to."""

    range_m: tuple[float, float] = (0.0, np.inf)
    view_rad: tuple[float, float] | None = None


def echoes(ranges_m: NDArray[np.floating], range_min_m: float, range_max_m: float) -> Array:
    """Ranges (N,) with inf for whatever a driver says when there is none.

    That is infinite or not a number, zero, beyond the limits of the sensor, or equal to the upper one.
    """
    ranges = np.asarray(ranges_m, dtype=np.float64)
    if not (np.isfinite(range_max_m) and range_max_m > max(range_min_m, 0.0)):
        range_max_m = np.inf
    with np.errstate(invalid="ignore"):
        seen = (ranges > 0) & (ranges >= range_min_m) & (ranges < range_max_m - _AT_LIMIT_M)
    return np.where(seen, ranges, np.inf)


def sweep(
    angles_rad: Array,
    ranges_m: Array,
    base_from_lidar: Array,
    base_from_then: Array | None = None,
    limits: Limits | None = None,
) -> Beams:
    """The beams of one LiDAR: angles and ranges (N,) in its frame, mounted at `base_from_lidar` (4, 4), tilted or not.

    `base_from_then` (N, 3) says where the base was at the time of each beam, in the base frame of the moment that is
    asked for.
    """
    limits = limits or Limits()
    directions = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1) @ base_from_lidar[:2, :2].T
    flat = np.hypot(directions[:, 0], directions[:, 1])
    mounted = np.column_stack(
        [
            np.broadcast_to(base_from_lidar[:2, 3], directions.shape),
            np.arctan2(directions[:, 1], directions[:, 0]),
        ]
    )
    if base_from_then is not None:
        mounted = compose(base_from_then, mounted)
    angle = wrap(mounted[:, 2])
    ranges = np.where((ranges_m >= limits.range_m[0]) & (ranges_m <= limits.range_m[1]), ranges_m * flat, np.inf)
    order = np.argsort(angle, kind="stable")
    if limits.view_rad is not None:
        low, high = limits.view_rad
        order = order[(angle[order] - low) % (2 * np.pi) <= high - low]
        order = order[np.argsort((angle[order] - low) % (2 * np.pi), kind="stable")]
    return _sorted(mounted[order, :2], angle[order], ranges[order])


def _sorted(origins: Array, angles: Array, ranges: Array) -> Beams:
    gaps = (np.roll(angles, -1) - angles) % (2 * np.pi)
    spacing = float(np.median(gaps)) if len(angles) > 2 else 2 * np.pi
    # The widest gap is where the sweep begins and ends.
    first = 0 if not len(angles) or gaps.max() <= _SEAM * spacing else int(np.argmax(gaps)) + 1
    order = np.roll(np.arange(len(angles)), -first)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    closed = len(angles) > 2 and first == 0 and float(gaps[-1]) <= _SEAM * spacing
    return Beams(
        origins[order], directions[order], angles[order], ranges[order], (0, len(angles)), (spacing,), (closed,)
    )


def together(sweeps: Sequence[Beams]) -> Beams:
    """Several LiDARs' beams."""
    counts = [0, *(len(one.ranges_m) for one in sweeps)]
    return Beams(
        np.concatenate([one.origins_xy for one in sweeps]),
        np.concatenate([one.directions_xy for one in sweeps]),
        np.concatenate([one.angles_rad for one in sweeps]),
        np.concatenate([one.ranges_m for one in sweeps]),
        tuple(np.cumsum(counts).tolist()),
        tuple(one.spacing_rad[0] for one in sweeps),
        tuple(one.is_closed[0] for one in sweeps),
    )
