"""Pieces of a log merged in the order of time; a piece is opened only when its time has come."""

import heapq
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar


class Timed(Protocol):
    """A message, or several that stay together: of the log time of the first."""

    @property
    def log_time_ns(self) -> int:
        """Its log time."""


T = TypeVar("T", bound=Timed)
Piece = tuple[int, Callable[[], Iterable[T]]]
_END = 2**64
"""After every log time that there can be: MCAP's have 64 bits without a sign."""


def merge(pieces: Iterable[Piece[T]]) -> Iterator[T]:
    """Messages of all pieces by log time; equal times keep the order of the pieces.

    Each piece is the time of its first message, and what opens it; its messages come in order. Only pieces that
    overlap in time are open together.
    """
    active: list[tuple[int, int, T, Iterator[T]]] = []
    for order, (start_ns, open_piece) in enumerate(sorted(pieces, key=lambda piece: piece[0])):
        yield from _drain(active, start_ns)
        messages = iter(open_piece())
        first = next(messages, None)
        if first is not None:
            heapq.heappush(active, (first.log_time_ns, order, first, messages))
    yield from _drain(active, _END)


def _drain(active: list[tuple[int, int, T, Iterator[T]]], until_ns: int) -> Iterator[T]:
    while active and active[0][0] <= until_ns:
        _, order, message, messages = active[0]
        yield message
        if len(active) == 1 and until_ns == _END:  # nothing is left to compare with
            active.clear()
            yield from messages
            return
        following = next(messages, None)
        if following is None:
            heapq.heappop(active)
        else:
            heapq.heapreplace(active, (following.log_time_ns, order, following, messages))
