"""Parts of files that are read more than once: kept in memory for as long as the process runs, within bounds."""

import threading
from bisect import bisect_right, insort
from collections import OrderedDict

from mcap_landmarks import memory

_MOST_GATHERED = 32 << 20
"""The heads of half a million chunks, or the beginnings and ends of 400 recordings."""
_MOST_RECENT, _LARGEST_RECENT = 64 << 20, 2 << 20
"""Of an hour's log all chunks but those of images and clouds. Verbs read some topics often, by and by, such as where
sensors are; those of many bytes they read once for each stage."""


class KeptParts:
    """Parts of one content, by where they begin."""

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

    def remove(self, start: int) -> None:
        """Forget the part that begins there."""
        del self._starts[bisect_right(self._starts, start) - 1]
        self.size -= len(self._contents.pop(start))

    def covering(self, place: int) -> tuple[int, bytes] | None:
        """A part that has the byte at a place, and where that begins."""
        number = bisect_right(self._starts, place) - 1
        if number < 0:
            return None
        begin = self._starts[number]
        content = self._contents[begin]
        return (begin, content) if place < begin + len(content) else None

    def has(self, start: int, end: int) -> bool:
        """Whether one part has all bytes from one place to another."""
        found = self.covering(start)
        return found is not None and end <= found[0] + len(found[1])


class KeptContent:
    """What is kept of one content of one URL: what was gathered, and the small parts that were read last."""

    def __init__(self, owner: "_AllKept") -> None:
        self._owner = owner
        self.gathered, self.recent = KeptParts(), KeptParts()

    def covering(self, place: int) -> tuple[int, bytes] | None:
        """See `KeptParts`."""
        with self._owner.lock:
            found = self.gathered.covering(place) or self.recent.covering(place)
            if found is not None:
                self._owner.touch(self, found[0])
            return found

    def has(self, start: int, end: int) -> bool:
        """See `KeptParts`."""
        with self._owner.lock:
            return self.gathered.has(start, end) or self.recent.has(start, end)

    def gather(self, start: int, content: bytes) -> None:
        """Keep a part as long as the content is known."""
        with self._owner.lock:
            self.gathered.add(start, content)

    def read(self, start: int, content: bytes) -> None:
        """Keep a part that was read, unless it is large, until others push it out."""
        if len(content) <= _LARGEST_RECENT:
            with self._owner.lock:
                before = self.recent.size
                self.recent.add(start, content)
                self._owner.remember(self, start, self.recent.size - before)


class _AllKept:
    """What is kept of all contents, the least recently used of which gives way first."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._of: OrderedDict[tuple[str, str], KeptContent] = OrderedDict()
        self._order: OrderedDict[tuple[KeptContent, int], None] = OrderedDict()
        self._recent_bytes = 0

    def of(self, text: str, version: str) -> KeptContent:
        """That of a URL's content; of one that has no version nothing is kept for the next opening."""
        with self.lock:
            if not version:
                return KeptContent(self)
            found = self._of.setdefault((text, version), KeptContent(self))
            self._of.move_to_end((text, version))
            while len(self._of) > 1 and sum(kept.gathered.size for kept in self._of.values()) > _MOST_GATHERED:
                self._of.popitem(last=False)
            return found

    def touch(self, kept: KeptContent, start: int) -> None:
        """A part was used."""
        if (kept, start) in self._order:
            self._order.move_to_end((kept, start))

    def remember(self, kept: KeptContent, start: int, grown: int) -> None:
        """A part was read, of so many bytes more; the parts that were not used for longest are forgotten."""
        self._order[kept, start] = None
        self._order.move_to_end((kept, start))
        self._recent_bytes += grown
        most = min(_MOST_RECENT, memory.bound() // 16)
        while self._recent_bytes > most:
            (oldest, place), _ = self._order.popitem(last=False)
            before = oldest.recent.size
            oldest.recent.remove(place)
            self._recent_bytes -= before - oldest.recent.size

    def forget(self) -> None:
        """Keep nothing of what was read so far."""
        with self.lock:
            self._of.clear()
            self._order.clear()
            self._recent_bytes = 0


ALL = _AllKept()
