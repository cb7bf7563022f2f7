"""Where the parts of a split log begin: at log times, so that no two parts overlap."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from mcap_landmarks.errors import UsageError

_MOST_PARTS = 10_000
"""More files than that in one folder are taken for a mistake: a log with stamps of 0 and of today lasts 56 years."""


@dataclass(frozen=True, slots=True)
class Split:
    """How long a part is: about so many bytes, so much time, or at most so many messages; one of them is given."""

    size_bytes: int | None = None
    duration_ns: int | None = None
    count: int | None = None


@dataclass(frozen=True, slots=True)
class TimedBytes:
    """Messages from a log time to another, the latter included, and the bytes that they take."""

    start_ns: int
    end_ns: int
    size_bytes: int


def cuts(split: Split, stretches: Iterable[TimedBytes]) -> list[int]:
    """The log times at which a part begins, but for the first one; stretches come by their start.

    Raises:
        UsageError: the parts are too many.
    """
    if split.duration_ns is not None:
        found: Iterable[int] = _by_duration(stretches, split.duration_ns)
    elif split.count is not None:
        found = _by_count((stretch.start_ns for stretch in stretches), split.count)
    else:
        found = _by_size(stretches, split.size_bytes or 1)
    times: list[int] = []
    for time_ns in found:
        times.append(time_ns)
        if len(times) >= _MOST_PARTS:
            raise UsageError(f"the split would make more than {_MOST_PARTS} files; make the parts larger")
    return times


def spans(start_ns: int | None, end_ns: int | None, times: list[int]) -> list[tuple[int | None, int | None]]:
    """First and end time of each part of a time range that begins anew at these times."""
    return list(pairwise([start_ns, *times, end_ns]))


def _by_duration(stretches: Iterable[TimedBytes], duration_ns: int) -> Iterator[int]:
    first_ns, last = None, 0
    for stretch in stretches:
        first_ns = stretch.start_ns if first_ns is None else first_ns
        begun, ended = ((time - first_ns) // duration_ns for time in (stretch.start_ns, stretch.end_ns))
        for number in range(max(begun, last + 1), ended + 1):
            yield first_ns + number * duration_ns
        last = max(last, ended)


def _by_count(times_ns: Iterable[int], count: int) -> Iterator[int]:
    """Messages of equal time stay together, in the part where there is room for all; so many at once are one part."""
    before = together = 0  # messages of the part before those of the latest time, and those
    latest_ns = None
    for time_ns in times_ns:
        if time_ns != latest_ns:
            before, together, latest_ns = before + together, 0, time_ns
        together += 1
        if before and before + together > count:
            before = 0
            yield time_ns


def _by_size(stretches: Iterable[TimedBytes], size_bytes: int) -> Iterator[int]:
    size, begun_ns = 0, None
    for time_ns, share in _points(stretches):
        begun_ns = time_ns if begun_ns is None else begun_ns
        if size + share > size_bytes and time_ns > begun_ns:
            yield time_ns
            size, begun_ns = 0, time_ns
        size += share


def _points(stretches: Iterable[TimedBytes]) -> Iterator[tuple[int, int]]:
    """Times with the bytes from each on: those of a stretch spread evenly over its time."""
    several = list[tuple[int, int]]()
    for stretch in stretches:
        lasts, number = stretch.end_ns - stretch.start_ns, _POINTS if stretch.end_ns > stretch.start_ns else 1
        several += [(stretch.start_ns + lasts * i // number, stretch.size_bytes // number) for i in range(number)]
        several.sort()
        while several and several[0][0] <= stretch.start_ns:
            yield several.pop(0)
    yield from several


_POINTS = 8
"""Into so many equal shares the bytes of a chunk are divided: a part is right to an eighth of its chunks."""
