"""Small parts of files that are read more than once: kept in memory for as long as the process runs, within a bound."""

import threading
from bisect import bisect_right, insort
from collections import OrderedDict

_MOST_BYTES = 32 << 20
"""The heads of half a million chunks, or the beginning and end of 400 recordings."""


class KeptParts:
    """Parts of one content, which do not overlap."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._contents: dict[int, bytes] = {}
        self.size = 0

    def add(self, start: int, content: bytes) -> None:
        """Keep a part; where one begins there, the longer of the two."""
        known = self._contents.get(start)
        if known is None:
            insort(self._starts, start)
        elif len(known) >= len(content):
            return
        self._contents[start] = content
        self.size += len(content) - len(known or b"")

    def covering(self, start: int) -> tuple[int, bytes] | None:
        """A part that has the byte at a place, and where that begins."""
        number = bisect_right(self._starts, start) - 1
        if number < 0:
            return None
        begin = self._starts[number]
        content = self._contents[begin]
        return (begin, content) if start < begin + len(content) else None


class _AllKept:
    """The parts of all contents, the least recently opened of which give way first."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: OrderedDict[tuple[str, str], KeptParts] = OrderedDict()

    def of(self, text: str, version: str) -> KeptParts:
        """Those of a URL's content; of one that has no version nothing is kept for the next opening."""
        if not version:
            return KeptParts()
        with self._lock:
            found = self._of.setdefault((text, version), KeptParts())
            self._of.move_to_end((text, version))
            while len(self._of) > 1 and sum(parts.size for parts in self._of.values()) > _MOST_BYTES:
                self._of.popitem(last=False)
        return found

    def forget(self) -> None:
        """Keep nothing of what was read so far."""
        with self._lock:
            self._of.clear()


ALL = _AllKept()
