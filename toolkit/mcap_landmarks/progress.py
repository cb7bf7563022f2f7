"""How long work tells whoever waits for it how far it got."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Protocol

Progress = Callable[[int], None]
"""Is told how much was done since the last time: bytes, where nothing else is said."""


class Watch(Protocol):
    """Shows the progress of work, such as `mcap_landmarks.cli.console.progress`."""

    def __call__(self, label: str, total: int | None, unit: str = ..., /) -> AbstractContextManager[Progress]:
        """What is done, how much there is to do, if that is known, and what is counted: bytes, if nothing is said."""


@contextlib.contextmanager
def unwatched(_label: str, _total: int | None, _unit: str = "bytes") -> Iterator[Progress]:
    """Shows nothing."""
    yield lambda _advance: None
