"""Scans whose numbers cannot be what LaserScan says that they are: read as what they are, or named.

A scan that is as the standard has it is never touched. Another one is repaired where its numbers have exactly one
reading; where they have none, or two, it is refused with the reason.
"""

import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import MessageError
from mcap_landmarks.lidar.scan_angles import with_angles
from mcap_landmarks.lidar.scan_times import with_times
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan

MILLIMETRES = "scans in millimetres, read as such"
LIMITS_IN_MILLIMETRES = "scans with range_min and range_max in millimetres, read as such"
HIDING = "scans whose range_max hides most of what came back; all of it is read"

_FAR_M = 100.0
"""Half of what comes back is nearer than this: planar LiDARs reach 4 to 80 m. In millimetres it is 10 cm, and half of
what comes back is farther than that."""
_LONGEST_M, _SHORTEST_M = 300.0, 2.0
"""The ranges of planar LiDARs lie between these, with room."""
_BLIND_M = 10.0
"""No planar LiDAR is blind within so much."""
_CM_PER_M = 100
_USUAL_M, _BLIND_BY_DESIGN_M, _REACH_M = 15.0, 0.5, 100.0
"""Read as centimetres, half of what comes back is nearer than the first, and the limits are of a LiDAR that is blind
within no more than the second and reaches no farther than the third, with room."""
_INSIDE = 0.95
"""Of the ranges of a scan so many are within its limits, if both are in the unit that they are taken for."""
_AT_LIMIT_M = 1e-3
"""As near to the upper limit a range says that there was no echo, see `beams.echoes`."""
_MOST, _VARIED = 0.5, 0.25
"""Most is more than half. Fewer distinct values beyond the limit are codes for "nothing came back", as measured ranges
hardly repeat."""
_PERIODS = 9
"""The median of so many times between scans is the usual one."""


class ScanTopic:
    """The scans of one topic, one after the other: each is repaired with the time between those before it."""

    def __init__(self) -> None:
        self._stamps_ns: deque[int] = deque(maxlen=_PERIODS + 1)

    def take(self, message: LaserScan | MultiEchoLaserScan) -> tuple[LaserScan, tuple[str, ...]]:
        """The next scan, of several echoes the nearest, and what was repaired, in words; see `repaired`."""
        scan = message.nearest if isinstance(message, MultiEchoLaserScan) else message
        if scan.stamp_ns:
            self._stamps_ns.append(scan.stamp_ns)
        steps = np.diff(np.array(self._stamps_ns, dtype=np.int64))
        steps = steps[steps > 0]
        return repaired(scan, float(np.median(steps)) * 1e-9 if len(steps) else 0.0)


def repaired(scan: LaserScan, period_s: float = 0.0) -> tuple[LaserScan, tuple[str, ...]]:
    """A scan as the standard has it, and what was repaired for that, in words; `period_s` between scans, 0 unknown.

    Where the times of beams cannot be known but the scan takes a while, `time_increment_s` is zero and `scan_time_s`
    says how long.

    Raises:
        MessageError: its numbers have no reading, or more than one.
    """
    scan, of_angles = with_angles(scan)
    scan, of_ranges = _with_ranges(scan)
    scan, of_times = with_times(scan, period_s)
    return scan, (*of_angles, *of_ranges, *of_times)


def _with_ranges(scan: LaserScan) -> tuple[LaserScan, tuple[str, ...]]:
    """The scan with ranges and limits in metres, without an upper limit that hides most of what came back."""
    scan, done = _in_metres(_with_limits(scan))
    returned = scan.ranges_m[np.isfinite(scan.ranges_m) & (scan.ranges_m > 0)]
    if not (math.isfinite(scan.range_max_m) and scan.range_max_m > max(scan.range_min_m, 0.0)):
        return scan, done
    hidden = returned[returned >= scan.range_max_m - _AT_LIMIT_M]
    if len(hidden) > _MOST * len(returned) and len(np.unique(hidden)) > max(_VARIED * len(hidden), 1):
        return replace(scan, range_max_m=math.inf), (*done, HIDING)
    return scan, done


def _with_limits(scan: LaserScan) -> LaserScan:
    """The scan with limits that are numbers: one that is none is not set."""
    lowest, highest = scan.range_min_m, scan.range_max_m
    if not (math.isnan(lowest) or math.isnan(highest)):
        return scan
    lowest, highest = (0.0 if math.isnan(limit) else limit for limit in (lowest, highest))
    return replace(scan, range_min_m=lowest, range_max_m=highest)


def _in_metres(scan: LaserScan) -> tuple[LaserScan, tuple[str, ...]]:
    lowest, highest = (
        limit / 1000 if math.isfinite(limit) and limit > most else limit
        for limit, most in ((scan.range_min_m, _BLIND_M), (scan.range_max_m, _LONGEST_M))
    )
    usual = _usual(scan.ranges_m)
    if usual <= _FAR_M:
        if lowest == scan.range_min_m:
            return scan, ()
        return replace(scan, range_min_m=lowest, range_max_m=highest), (LIMITS_IN_MILLIMETRES,)
    if usual > 1000 * _FAR_M or (highest != scan.range_max_m and highest < _SHORTEST_M):
        raise MessageError(
            f"a scan's ranges are neither in metres nor in millimetres: {usual:.6g} is the usual one, and range_max is "
            f"{scan.range_max_m:.6g}"
        )
    if _can_be_centimetres(scan, usual):
        raise MessageError(
            f"a scan's ranges are in millimetres or in centimetres, which of them is not clear: {usual:.6g} is the "
            f"usual one, range_min is {scan.range_min_m:.6g} and range_max {scan.range_max_m:.6g}"
        )
    ranges = scan.ranges_m / np.float32(1000)
    return replace(scan, ranges_m=ranges, range_min_m=lowest, range_max_m=highest), (MILLIMETRES,)


def _can_be_centimetres(scan: LaserScan, usual: float) -> bool:
    """Whether ranges that are not in metres make sense as centimetres, be the limits in them, in metres or not set."""
    if usual > _CM_PER_M * _USUAL_M:
        return False
    lowest, highest = max(scan.range_min_m, 0.0), scan.range_max_m
    if not (math.isfinite(highest) and highest > lowest):
        highest = math.inf
    elif highest > _LONGEST_M:  # both limits are in the unit of the ranges
        lowest, highest = lowest / _CM_PER_M, highest / _CM_PER_M
        if lowest > _BLIND_BY_DESIGN_M or highest > _REACH_M:
            return False
    distinct = _distinct(scan.ranges_m) / _CM_PER_M
    return float(np.mean((distinct >= lowest) & (distinct <= highest))) >= _INSIDE


def _usual(ranges_m: NDArray[np.float32]) -> float:
    """The median of the distinct ranges (N,): what drivers say when nothing came back is one value, however often."""
    distinct = _distinct(ranges_m)
    return float(np.median(distinct)) if len(distinct) else 0.0


def _distinct(ranges_m: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.unique(ranges_m[np.isfinite(ranges_m) & (ranges_m > 0)])
