"""Parts of a file in the order in which they will be read: fetched ahead, several at once, within a bound of bytes."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

from mcap_landmarks import memory
from mcap_landmarks.remote.announced_file import Part

AT_ONCE = 16
"""Requests: with 20 ms each, images of a 1 GB log come as fast as with none (`tests.benchmark.remote`, 230 MB/s on two
cores), and 900 heads of chunks no faster with 32."""
LARGEST_JOINED = 2 << 20
"""Bytes of a request for several parts: large enough that requests cost little, small enough that several run."""
_ANY_GAP, _LARGEST_GAP, _MOST_WASTE = 4 << 10, 32 << 10, 0.1
"""Bytes between parts: so few cost less than a request, whose heads alone are 1 kB; more, up to some, are fetched
where they are a small share of what is wanted before them, so that one topic costs little more than its chunks."""
_MOST_AHEAD = 64 << 20
"""Bytes: 20 ms of a network of 25 Gbit/s."""


class _Piece(NamedTuple):
    start: int
    end: int
    content: "Future[bytes]"


def joined(parts: Iterable[Part]) -> Iterator[tuple[Part, ...]]:
    """Parts one after the other, those together that nearly touch: a request takes longer than to fetch what is
    between them.

    Only parts in the order of the file are joined, up to `LARGEST_JOINED` bytes.
    """
    group: list[Part] = []
    end, wanted = 0, 0
    for part in parts:
        if group and not _joins(part, group, end, wanted):
            yield tuple(group)
            group, end, wanted = [], 0, 0
        group.append(part)
        end, wanted = max(end, part[1]), wanted + part[1] - part[0]
    if group:
        yield tuple(group)


def _joins(part: Part, group: list[Part], end: int, wanted: int) -> bool:
    """Whether a part joins those before it, which end there and are of so many bytes."""
    if part[0] < group[-1][0] or part[1] - group[0][0] > LARGEST_JOINED:
        return False
    gap, between = part[0] - end, part[0] - group[0][0] - wanted
    return gap <= _ANY_GAP or (gap <= _LARGEST_GAP and between <= _MOST_WASTE * wanted)


class ReadingPlan:
    """What will be read of a file next, one part after the other; `fetch` gets one, in a thread of the pool.

    Parts are fetched from the first on: no more than `AT_ONCE` that are not there yet, and no more bytes than a part
    of the bound on memory. One that was passed over is given up. `keep` gets each part that is there.
    """

    def __init__(
        self,
        parts: Iterable[Part],
        fetch: Callable[[int, int], bytes],
        keep: Callable[[int, bytes], None],
        pool: ThreadPoolExecutor,
        most: int = _MOST_AHEAD,
    ) -> None:
        self._coming, self._fetch, self._keep, self._pool = joined(parts), fetch, keep, pool
        self._next = next(self._coming, None)
        self._pieces: deque[_Piece] = deque()
        self._ahead, self._most = 0, min(most, memory.bound() // 8)

    def start(self) -> None:
        """Begin to fetch."""
        self._go_on()

    def covering(self, place: int) -> tuple[int, bytes] | None:
        """The piece that has the byte at a place, and where it begins; waits for it. None if it is not to come.

        Raises:
            RemoteError: it could not be fetched.
        """
        found = next((piece for piece in self._pieces if piece.start <= place < piece.end), None)
        if found is None:
            return None
        while self._pieces[0] is not found:
            passed = self._pieces.popleft()
            passed.content.cancel()
            self._ahead -= passed.end - passed.start
        self._go_on()
        content = found.content.result()
        self._go_on()
        return found.start, content

    def close(self) -> None:
        """Fetch nothing more."""
        self._next = None
        while self._pieces:
            self._pieces.popleft().content.cancel()

    def _get(self, parts: tuple[Part, ...], start: int, end: int) -> bytes:
        content = self._fetch(start, end)
        for begin, stop in parts:
            self._keep(begin, content[begin - start : stop - start])
        return content

    def _go_on(self) -> None:
        """Begin to fetch what comes next, as far as the bounds permit; one piece is always permitted."""
        while self._next is not None:
            start, end = self._next[0][0], max(end for _, end in self._next)
            open_requests = sum(not piece.content.done() for piece in self._pieces)
            if self._pieces and (open_requests >= AT_ONCE or self._ahead + end - start > self._most):
                return
            content = self._pool.submit(self._get, self._next, start, end)
            self._pieces.append(_Piece(start, end, content))
            self._ahead += end - start
            self._next = next(self._coming, None)
