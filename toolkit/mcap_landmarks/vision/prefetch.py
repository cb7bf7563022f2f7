"""Work in overlapping steps: prepare and run items ahead in threads, results in the order of the items."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Prepared = TypeVar("Prepared")
Result = TypeVar("Result")

AHEAD = 3
"""Items under way beside those that are run: enough to keep the slowest step busy, few enough to bound memory."""


def in_order(
    items: Iterable[Item],
    prepare: Callable[[Item], Prepared],
    run: Callable[[Prepared], Result],
    at_once: int = 1,
    preparing: int = 1,
) -> Iterator[tuple[Item, Result]]:
    """Every item with `run(prepare(item))`; what either raises is raised when the item's turn comes.

    Items are drawn and results taken in the caller's thread, so both may do I/O; `at_once` calls of `run` overlap,
    and `preparing` ones of `prepare`.
    """
    under_way: deque[tuple[Item, Future[Result]]] = deque()
    with ThreadPoolExecutor(preparing) as preparers, ThreadPoolExecutor(at_once) as runners:

        def finish(prepared: "Future[Prepared]") -> Result:
            return run(prepared.result())

        for item in items:
            under_way.append((item, runners.submit(finish, preparers.submit(prepare, item))))
            while under_way and (len(under_way) >= at_once + AHEAD or under_way[0][1].done()):
                first, future = under_way.popleft()
                yield first, future.result()
        while under_way:
            first, future = under_way.popleft()
            yield first, future.result()
