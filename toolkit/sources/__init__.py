"""Foreign formats, one file each: whatever module in this folder has a `SOURCE` can be converted."""

import importlib
import pkgutil
from functools import cache
from pathlib import Path

from toolkit.errors import RecordingError
from toolkit.sources.source import Source


@cache
def sources() -> dict[str, Source]:
    """Every source by its name."""
    found = {}
    for entry in pkgutil.iter_modules(__path__):
        source = getattr(importlib.import_module(f"{__name__}.{entry.name}"), "SOURCE", None)
        if isinstance(source, Source):
            found[source.name] = source
    return found


def source_of(path: Path) -> Source:
    """The source that reads a path.

    Raises:
        RecordingError: there is nothing at the path, or no source knows it.
    """
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder; check the path")
    for source in sources().values():
        if source.recognises(path):
            return source
    known = "; ".join(source.reads for source in sources().values())
    raise RecordingError(f"{path} is nothing that can be converted; known are: {known}")


__all__ = ["Source", "source_of", "sources"]
