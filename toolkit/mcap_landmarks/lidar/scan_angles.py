"""The directions of a scan's beams in radians, where its angles can be read as such."""

import math
from dataclasses import replace

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.scan import LaserScan

DEGREES = "scans with angles in degrees, read as such"
INCREMENT_UNSET = "scans without angle_increment; it is read from angle_min, angle_max and the number of beams"
INCREMENT_TOO_LARGE = (
    "scans whose angle_increment makes more than a turn; it is read from angle_min, angle_max and the number of beams"
)

_DEGREES_TOO: tuple[str, ...] = (DEGREES, INCREMENT_UNSET)

_MOST_RAD, _LEAST_RAD = 2.2 * math.pi, 0.1
"""No scan is of more than a turn, give or take what LiDARs turn too far, and none of less than 6 degrees."""
_WHOLE = 0.95
"""So much of a turn is a full one: pi and -pi, and what limits of it lie between, are one direction."""
_BEAMS_OFF, _SHARE_OFF = 1.5, 0.002
"""Drivers count the beam at angle_max or not, and round to two digits (6.28)."""


def with_angles(scan: LaserScan) -> tuple[LaserScan, tuple[str, ...]]:
    """A scan with angles as the standard has them, and what was repaired for that, in words.

    Raises:
        MessageError: they have no reading, or more than one.
    """
    _check(scan)
    last, first, step = len(scan.ranges_m) - 1, scan.angle_min_rad, scan.angle_increment_rad
    span = scan.angle_max_rad - first if math.isfinite(scan.angle_max_rad) else 0.0
    limits = span if scan.angle_max_rad else 0.0  # what is not set is zero
    has_step = bool(step) and math.isfinite(step)
    if has_step and abs(step * last) <= _MOST_RAD and (not limits or _fits(step, limits, last)):
        return scan, ()
    in_degrees = max(abs(span), abs(first)) > _MOST_RAD
    unit = math.radians(1.0) if in_degrees else 1.0
    if has_step:
        step, done = _reading(step, limits * unit, last, in_degrees)
    else:
        step, done = _from_limits(span * unit, last), _DEGREES_TOO if in_degrees else (INCREMENT_UNSET,)
    if not step:
        raise MessageError(_contradiction(scan))
    first, span = first * unit, span * unit
    return replace(scan, angle_min_rad=first, angle_max_rad=first + span, angle_increment_rad=step), done


def _check(scan: LaserScan) -> None:
    if len(scan.ranges_m) < 2:
        raise MessageError(f"a scan of {len(scan.ranges_m)} beams shows nothing")
    if not math.isfinite(scan.angle_min_rad):
        raise MessageError(f"a scan's angle_min is {scan.angle_min_rad}: the directions of its beams are not known")


def _from_limits(span_rad: float, last: int) -> float:
    """The increment of beams between limits that so much lies between, 0 where that is no scan."""
    return span_rad / last if _LEAST_RAD < abs(span_rad) <= _MOST_RAD else 0.0


def _reading(step: float, span_rad: float, last: int, in_degrees: bool) -> tuple[float, tuple[str, ...]]:
    """The increment in rad of one that does not fit, 0 where that is not clear; limits are 0 apart where unset."""
    turned = math.radians(step)
    if abs(step * last) <= _MOST_RAD:  # it can be in radians, with limits in degrees
        return (step, (DEGREES,)) if in_degrees and _fits(step, span_rad, last) else (0.0, ())
    if _fits(turned, span_rad, last) if span_rad else _LEAST_RAD < abs(turned * last) <= _MOST_RAD:
        return turned, (DEGREES,)
    is_clear = not in_degrees and step * span_rad > 0
    return (_from_limits(span_rad, last) if is_clear else 0.0), (INCREMENT_TOO_LARGE,)


def _fits(step_rad: float, span_rad: float, last: int) -> bool:
    """Whether so many steps span what limits do, give or take a turn, as limits may lie on both sides of its seam.

    Where they do so with the other sign too and without a turn, the sign or the limits are wrong: that has two readings
    unless it is a full turn to the left, which begins at pi or, as its limits say, at -pi.
    """
    most = _BEAMS_OFF * abs(step_rad) + _SHARE_OFF * abs(span_rad)
    if abs(step_rad * last + span_rad) <= most and not (step_rad > 0 and abs(span_rad) >= _WHOLE * 2 * math.pi):
        return False
    return abs(math.remainder(step_rad * last - span_rad, 2 * math.pi)) <= most


def _contradiction(scan: LaserScan) -> str:
    if not scan.angle_increment_rad or not math.isfinite(scan.angle_increment_rad):
        return "a scan has neither angle_increment nor limits: in which directions its beams are is not known"
    if scan.angle_increment_rad * (scan.angle_max_rad - scan.angle_min_rad) < 0:
        return (
            f"a scan's angle_increment contradicts its limits: by {scan.angle_increment_rad:.6g} rad beams do not go "
            f"from angle_min {scan.angle_min_rad:.6g} to angle_max {scan.angle_max_rad:.6g}, but the other way round"
        )
    return (
        f"a scan's angle_increment contradicts its limits: {len(scan.ranges_m)} beams, each by "
        f"{scan.angle_increment_rad:.6g} rad on from angle_min {scan.angle_min_rad:.6g}, do not end at angle_max "
        f"{scan.angle_max_rad:.6g}"
    )
