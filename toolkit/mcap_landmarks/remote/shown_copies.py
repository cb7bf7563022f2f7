"""What is shown of copies: that one is made, by context variables, and the URL in place of the path of each.

Neither is a matter of the verb that names the file.
"""

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path

from mcap_landmarks.progress import Watch, unwatched

WATCH: ContextVar[Watch] = ContextVar("watch", default=unwatched)
NOTE: ContextVar[Callable[[str], None]] = ContextVar("note", default=lambda _text: None)
_urls: dict[str, str] = {}
"""The URL of each copy by its path, as they may be shown."""


def name_copy(path: Path, url: str) -> None:
    """Show a URL wherever the path of its copy would be shown."""
    _urls[str(path)] = url


def as_named(text: str) -> str:
    """A text in which copies go by the URLs that the user named."""
    for path, url in _urls.items():
        text = text.replace(path, url)
    return text


@contextlib.contextmanager
def copies_shown(watch: Watch, note: Callable[[str], None]) -> Iterator[None]:
    """Show the progress of every copy that is made while the block runs; `note` is told what is odd about one."""
    tokens = WATCH.set(watch), NOTE.set(note)
    try:
        yield
    finally:
        WATCH.reset(tokens[0])
        NOTE.reset(tokens[1])
