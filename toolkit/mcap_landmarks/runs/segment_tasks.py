"""How one long log is cut into segments, and who makes them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.locations import Location


@dataclass(frozen=True, slots=True)
class SegmentTask:
    """One segment of a log: the file for its results, and the text from which `run_segment` makes them."""

    log: Location
    target: Path
    text: str


@dataclass(frozen=True, slots=True)
class Segments:
    """A log is cut at multiples of `length_ns` of log time since 1970, whoever cuts it and wherever it begins.

    `run` has workers make the files of some segments, and tells each that is done, in whatever order.
    """

    length_ns: int
    run: Callable[[Sequence[SegmentTask]], Iterator[SegmentTask]]

    def bounds(self, first_ns: int, last_ns: int) -> list[tuple[int, int]]:
        """Start and end of all segments with messages between two times; ends are no part of them."""
        start, end = first_ns // self.length_ns, last_ns // self.length_ns + 1
        return [(i * self.length_ns, (i + 1) * self.length_ns) for i in range(start, end)]
