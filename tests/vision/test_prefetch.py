"""Steps that overlap: order, bounded memory, errors."""

import threading
from collections.abc import Iterator

import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.vision.prefetch import AHEAD, in_order


def test_steps_overlap_and_memory_is_bounded() -> None:
    drawn, both = 0, threading.Barrier(2, timeout=10)

    def items() -> Iterator[int]:
        nonlocal drawn
        for i in range(20):
            drawn += 1
            yield i

    def prepare(item: int) -> int:
        if item == 1:
            both.wait()
        return item

    def work(item: int) -> int:
        if item == 0:
            both.wait()  # only if 1 is being prepared while 0 is worked on
        return -item

    for position, (item, result) in enumerate(in_order(items(), prepare, work, at_once=2)):
        assert (item, result) == (position, -position)
        assert drawn <= position + 2 + AHEAD + 1


def test_errors_in_a_thread_come_out() -> None:
    def fail(item: int) -> int:
        if item == 3:
            raise RecordingError("three")
        return item

    stream = in_order(range(6), fail, lambda item: item)
    assert [next(stream)[1] for _ in range(3)] == [0, 1, 2]
    with pytest.raises(RecordingError, match="three"):
        next(stream)
