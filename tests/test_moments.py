"""Moments as users write them, and what is none."""

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.moments import time_ns


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1767225600000000000", 1767225600 * 10**9),
        ("-5", -5),
        ("2026-01-01T00:00:00.123456789Z", 1767225600 * 10**9 + 123456789),
        ("2026-01-01T01:00:00,5+01:00", 1767225600 * 10**9 + 5 * 10**8),
    ],
)
def test_a_moment_is_exact_to_the_nanosecond(text: str, expected: int) -> None:
    assert time_ns(text, "--start") == expected


@pytest.mark.parametrize("text", ["", "--5", "²", "1" * 5000, "2026-01-01T00:00:00", "2026-01-01", "yesterday", "1e9"])
def test_anything_else_is_refused_with_both_forms(text: str) -> None:
    with pytest.raises(UsageError, match="give RFC 3339 with an offset"):
        time_ns(text, "--start")
