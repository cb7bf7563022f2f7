"""A file elsewhere as a stream: reads what is asked for, what will be asked for next ahead, and no more."""

import io
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import pairwise
from typing import cast

from mcap_landmarks.remote import kept_parts
from mcap_landmarks.remote.announced_file import AnnouncedFile, Part
from mcap_landmarks.remote.reading_plan import AT_ONCE, ReadingPlan, joined
from mcap_landmarks.remote.refusals import persistently
from mcap_landmarks.remote.stored_file import StoredFile

_LEAST, _MOST_IN_ROW = 16 << 10, 4 << 20
"""Bytes of a request that nobody announced: the least, and the most when reading goes on and on where it ended."""
_ROW_AHEAD = 16 << 20


class RemoteFile(AnnouncedFile):
    """See the file's docstring. `text` is the URL; for one thread at a time.

    Every read raises RemoteError if the file cannot be read, or is another than when it was opened.
    """

    def __init__(self, text: str, stored: StoredFile, is_closed: threading.Event) -> None:
        self._text, self._stored, self._is_closed = text, stored, is_closed
        self._position = 0
        self._kept = kept_parts.ALL.of(text, stored.version)
        if stored.begin:
            self._kept.gather(0, stored.begin)
        self._last: tuple[int, bytes] = 0, b""
        self._window = _LEAST
        self._plans: list[ReadingPlan] = []
        self._row: ReadingPlan | None = None
        self._pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="remote")

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """The place that is read next."""
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Read on from another place; asks nothing of anyone."""
        origin = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self._stored.size}[whence]
        self._position = max(origin + offset, 0)
        return self._position

    def read(self, size: int | None = -1) -> bytes:
        """So many bytes, all that are left by default; fewer at the end of the file."""
        start, rest = self._position, max(self._stored.size - self._position, 0)
        end = start + (rest if size is None or size < 0 else min(size, rest))
        pieces = []
        while self._position < end:
            begin, content = self._covering(self._position, end)
            pieces.append(content[self._position - begin : end - begin])
            self._position += len(pieces[-1])
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    def readinto(self, buffer: object) -> int:
        """As `read`, into a buffer."""
        view = memoryview(cast("bytearray", buffer)).cast("B")
        content = self.read(len(view))
        view[: len(content)] = content
        return len(content)

    def close(self) -> None:
        """Give up what was asked for."""
        if not self.closed:
            self._is_closed.set()
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._plans, self._row, self._last = [], None, (0, b"")
        super().close()

    @contextmanager
    def expecting(self, parts: Iterable[Part]) -> Iterator[None]:
        """See `AnnouncedFile`."""
        missing = (part for part in parts if not self._kept.has(*part))
        plan = ReadingPlan(missing, self._fetch, self._kept.read, self._pool)
        plan.start()
        self._plans.append(plan)
        try:
            yield
        finally:
            plan.close()
            if plan in self._plans:
                self._plans.remove(plan)

    def gather(self, parts: Iterable[Part]) -> None:
        """See `AnnouncedFile`."""
        wanted = sorted((max(start, 0), min(end, self._stored.size)) for start, end in parts)
        groups = list(joined(part for part in wanted if part[0] < part[1] and not self._kept.has(*part)))
        spans = [(group[0][0], max(end for _, end in group)) for group in groups]
        for group, (begin, _), content in zip(
            groups, spans, self._pool.map(lambda span: self._fetch(*span), spans), strict=True
        ):
            for start, end in group:
                self._kept.gather(start, content[start - begin : end - begin])

    def _fetch(self, start: int, end: int) -> bytes:
        return persistently(self._text, lambda: self._stored.bytes_of(start, end), self._is_closed)

    def _covering(self, place: int, end: int) -> tuple[int, bytes]:
        """Some bytes from a place on, and where they begin."""
        if self.closed:
            raise ValueError("I/O operation on closed file")
        for plan in self._plans:
            if (found := plan.covering(place)) is not None:
                return found
        if (known := self._kept.covering(place)) is not None:
            return known
        if 0 <= place - self._last[0] < len(self._last[1]):
            return self._last
        if self._row is not None and (found := self._row.covering(place)) is not None:
            return found
        self._last = self._unannounced(place, end)
        return self._last

    def _unannounced(self, place: int, end: int) -> tuple[int, bytes]:
        """What nobody said before that it would be read: from front to end in growing requests, soon ahead of need."""
        gone_on = place - (self._last[0] + len(self._last[1]))
        self._window = min(2 * self._window, _MOST_IN_ROW) if 0 <= gone_on <= self._window else _LEAST
        size = self._stored.size
        if self._window < _MOST_IN_ROW:
            stop = min(max(end, place + self._window), size)
            return place, self._fetch(place, stop)
        if self._row is not None:
            self._row.close()
        places = [*range(place, size, _MOST_IN_ROW), size]
        self._row = ReadingPlan(pairwise(places), self._fetch, _keep_none, self._pool, _ROW_AHEAD)
        self._row.start()
        found = self._row.covering(place)
        return found if found is not None else (place, self._fetch(place, end))


def _keep_none(_start: int, _content: bytes) -> None:
    """What is read in a row is not read again."""
