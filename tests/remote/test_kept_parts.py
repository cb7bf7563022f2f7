"""What is kept of files elsewhere stays within its bounds, and is never taken for another content."""

import pytest
from mcap_landmarks.remote.kept_parts import ALL, KeptParts


@pytest.fixture(autouse=True)
def _nothing_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcap_landmarks.remote.kept_parts._MOST_RECENT", 10)
    monkeypatch.setattr("mcap_landmarks.remote.kept_parts._LARGEST_RECENT", 6)
    ALL.forget()


def test_a_part_is_found_by_any_of_its_bytes() -> None:
    parts = KeptParts()
    parts.add(10, b"abc")
    parts.add(20, b"de")
    assert [parts.covering(place) for place in (9, 10, 12, 13, 21)] == [
        *(None, (10, b"abc"), (10, b"abc"), None),
        (20, b"de"),
    ]
    assert parts.has(10, 13)
    assert not parts.has(12, 14)
    parts.add(10, b"a")
    assert parts.covering(12) == (10, b"abc")  # the longer one stays
    parts.remove(10)
    assert (parts.covering(10), parts.size) == (None, 2)


def test_what_was_not_used_for_longest_gives_way() -> None:
    kept = ALL.of("memory://a", "1")
    kept.read(0, b"12345")
    kept.read(100, b"1234")
    assert kept.covering(2) == (0, b"12345")
    kept.read(200, b"123")
    assert [kept.has(place, place + 1) for place in (0, 100, 200)] == [True, False, True]
    kept.read(300, b"1234567")  # too large to be kept
    assert not kept.has(300, 301)


def test_of_another_version_and_of_none_nothing_is_known() -> None:
    ALL.of("memory://a", "1").gather(0, b"head")
    assert ALL.of("memory://a", "1").has(0, 4)
    assert not ALL.of("memory://a", "2").has(0, 4)
    ALL.of("memory://b", "").gather(0, b"head")
    assert not ALL.of("memory://b", "").has(0, 4)
