"""What a stream can be told of what will be read of it; loads nothing, as readers of local files import it, too."""

import io
from collections.abc import Iterable
from contextlib import AbstractContextManager

Part = tuple[int, int]
"""From one place of a file to another."""


class AnnouncedFile(io.RawIOBase):
    """A file of which several parts can be fetched at once, if they are known before they are read."""

    def expecting(self, parts: Iterable[Part]) -> AbstractContextManager[None]:
        """Fetch these ahead of need, in this order, while the block runs: each is read once, or passed over."""
        raise NotImplementedError

    def gather(self, parts: Iterable[Part]) -> None:
        """Fetch small parts at once, and keep them: they will be read more than once."""
        raise NotImplementedError
