"""Moments as text: RFC 3339 to the nanosecond."""

from datetime import UTC, datetime

LATEST_NS = 2**63 - 1
"""MCAP has unsigned log times; what is later than signed ones can be (year 2262) is damage and counts as this."""


def moment(time_ns: int) -> str:
    """RFC 3339 to the nanosecond, as --start and --end take it; a number where the calendar ends."""
    seconds, rest = divmod(time_ns, 10**9)
    try:
        when = datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):
        return str(time_ns)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"
