"""When the beams of a scan were measured, in seconds, where its times can be read as such."""

import math
from dataclasses import replace

from mcap_landmarks.messages.scan import LONGEST_S, LaserScan

TIME_OF_A_TURN = "scans whose time_increment is the time of the whole scan, read as such"
NO_TIMES = "scans whose time_increment cannot be; when their beams were measured is not known"

_UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_SHORTEST_S = 0.003
"""No LiDAR measures a scan faster: the quickest turn 100 times a second, and some show a third of the turn only."""
_LATE = 2.0
"""A sweep lasts no longer than so many periods of its scans: the scans of a real Neato that turns 5 times a second come
every 0.11 to 0.14 s."""
_EARLY = 0.3
"""A sweep takes no less than so much of its share of a turn: scan_time of a real Hokuyo is that of two turns."""
_SAME = 0.05
"""The time between scans varies by such a share."""
_USUAL_S = 0.2
"""How long a scan takes where nothing tells: small LiDARs turn 5 to 15 times a second."""


def with_times(scan: LaserScan, period_s: float) -> tuple[LaserScan, tuple[str, ...]]:
    """A scan with times as the standard has them, and what was repaired for that, in words.

    `period_s` is the time between scans, 0 where that is not known. Where the times of beams cannot be known,
    `time_increment_s` is zero, and `scan_time_s` how long the scan takes.
    """
    last, step_s = len(scan.ranges_m) - 1, scan.time_increment_s
    if 0 < step_s * last <= LONGEST_S:
        return scan, ()
    known_s = _seconds(scan.scan_time_s)[1] or (period_s if period_s <= LONGEST_S else 0.0)
    if step_s == 0:  # only the time of the whole scan may be odd
        return (replace(scan, scan_time_s=known_s) if scan.scan_time_s not in (0.0, known_s) else scan), ()
    if known_s and abs(step_s - known_s) < _SAME * known_s:
        return replace(scan, time_increment_s=step_s / last, scan_time_s=known_s), (TIME_OF_A_TURN,)
    unit, turn_s = _seconds(step_s * last)
    shown = min(abs(scan.angle_increment_rad) * last / (2 * math.pi), 1.0)
    least_s = _EARLY * shown * _seconds(scan.scan_time_s)[1]
    if unit and (not known_s or least_s <= turn_s <= _LATE * known_s):
        done = (f"scans whose time_increment is in {unit}, read as such",)
        return replace(scan, time_increment_s=step_s * _UNITS[unit], scan_time_s=known_s), done
    return replace(scan, time_increment_s=0.0, scan_time_s=known_s or _USUAL_S), (NO_TIMES,)


def _seconds(value: float) -> tuple[str, float]:
    """The unit of the time of a scan, empty for seconds, and the time; 0 where it can be none.

    Units are a thousand apart, and the times of scans less: at most one fits.
    """
    if 0 < value <= LONGEST_S:
        return "", value
    fitting = [(unit, value * factor) for unit, factor in _UNITS.items() if _SHORTEST_S <= value * factor <= LONGEST_S]
    return fitting[0] if fitting else ("", 0.0)
