"""Moments as text and from text: RFC 3339 to the nanosecond."""

import re
from datetime import UTC, datetime

from mcap_landmarks.errors import UsageError

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


def time_ns(text: str | None, option: str) -> int | None:
    """Nanoseconds since the epoch from RFC 3339 (an offset is required) or an integer.

    Raises:
        UsageError: the text is neither.
    """
    if text is None:
        return None
    if re.fullmatch(r"-?[0-9]{1,19}", text):  # more digits are of no time that a log can hold
        return int(text)
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        when = None
    if when is None or when.tzinfo is None:
        raise UsageError(f"{option} {text}: give RFC 3339 with an offset, such as 2026-01-31T12:00:00Z, or nanoseconds")
    whole = when.replace(microsecond=0)
    fraction = re.search(r"[.,]([0-9]+)", text)  # datetime keeps microseconds only
    return int(whole.timestamp()) * 10**9 + (int(fraction[1].ljust(9, "0")[:9]) if fraction else 0)
