"""Who is shown that a file is copied: context variables, as that is no matter of the verb that names the file."""

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar

from mcap_landmarks.progress import Watch, unwatched

WATCH: ContextVar[Watch] = ContextVar("watch", default=unwatched)
NOTE: ContextVar[Callable[[str], None]] = ContextVar("note", default=lambda _text: None)


@contextlib.contextmanager
def copies_shown(watch: Watch, note: Callable[[str], None]) -> Iterator[None]:
    """Show the progress of every copy that is made while the block runs; `note` is told what is odd about one."""
    tokens = WATCH.set(watch), NOTE.set(note)
    try:
        yield
    finally:
        WATCH.reset(tokens[0])
        NOTE.reset(tokens[1])
