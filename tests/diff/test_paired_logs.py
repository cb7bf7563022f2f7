"""Logs are paired by what was recorded, then by name."""

from dataclasses import dataclass

import pytest
from mcap_landmarks.diff.paired_logs import pair_logs


@dataclass(frozen=True)
class Log:
    name: str
    fingerprint: str | None


def logs(text: str) -> list[Log]:
    """Logs of `name:fingerprint` words; without a fingerprint they cannot be read."""
    return [Log(name, mark or None) for name, _, mark in (word.partition(":") for word in text.split())]


@pytest.mark.parametrize(
    ("baseline", "candidate", "expected"),
    [
        ("a:1 b:2", "b:2 a:1", [(0, 1, "fingerprint"), (1, 0, "fingerprint")]),
        ("a:1 b:2", "b:1 a:2", [(0, 0, "fingerprint"), (1, 1, "fingerprint")]),  # renamed
        ("a:1 b:2", "a:3 c:2", [(0, 0, "name"), (1, 1, "fingerprint")]),
        ("a:1 b:1", "b:1 a:1", [(0, 1, "fingerprint"), (1, 0, "fingerprint")]),  # one recording, two maps
        ("a:1 b:1", "b:1 c:1", [(0, 1, "fingerprint"), (1, 0, "fingerprint")]),  # the last two that are left
        ("a:1 b:1", "c:1 d:1", []),  # which is which?
        ("a: b:2", "a:1 b:2", [(0, 0, "name"), (1, 1, "fingerprint")]),
        ("a:1", "b:2", []),
    ],
)
def test_pairs(baseline: str, candidate: str, expected: list[tuple[int, int, str]]) -> None:
    assert [tuple(pair) for pair in pair_logs(logs(baseline), logs(candidate))] == expected
