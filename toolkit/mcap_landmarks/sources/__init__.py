"""Foreign formats, one file each, of one shape; found by name, and imported only when asked for."""

import importlib
import pkgutil
from pathlib import Path

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.sources._bag_metadata import recorded_metadata
from mcap_landmarks.sources._definition_files import definition_files
from mcap_landmarks.sources._foxglove_types import counterpart
from mcap_landmarks.sources._merge import Piece, merge
from mcap_landmarks.sources._ros1_back import Ros1Type, ros1_type
from mcap_landmarks.sources._shape import (
    BagDescription,
    Carried,
    Log,
    McapFile,
    OmittedTopic,
    Payload,
    Source,
    SourceLog,
    together,
)
from mcap_landmarks.sources._verification import defined, settled


def source_names() -> tuple[str, ...]:
    """Every source in this folder; files whose name begins with an underscore are parts of sources."""
    return tuple(sorted(entry.name for entry in pkgutil.iter_modules(__path__) if not entry.name.startswith("_")))


def find_source(name: str) -> Source:
    """The declaration of a source, imported now."""
    source = importlib.import_module(f"{__name__}.{name}").SOURCE
    assert isinstance(source, Source)  # noqa: S101 - a contract of this folder, held by tests/contract
    return source


def source_of(path: Path) -> Source:
    """The source that reads a path.

    Raises:
        RecordingError: there is nothing at the path, it may not be read, or no source knows it.
    """
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder; check the path")
    known = [find_source(name) for name in source_names()]
    try:
        for source in known:
            if source.recognises(path):
                return source
    except PermissionError as error:
        raise RecordingError(f"{path} may not be read; change its permissions") from error
    formats = "; ".join(source.reads for source in known)
    raise RecordingError(f"{path} is nothing that can be converted; known are: {formats}")


__all__ = [
    "BagDescription",
    "Carried",
    "Log",
    "McapFile",
    "OmittedTopic",
    "Payload",
    "Piece",
    "Ros1Type",
    "Source",
    "SourceLog",
    "counterpart",
    "defined",
    "definition_files",
    "find_source",
    "merge",
    "recorded_metadata",
    "ros1_type",
    "settled",
    "source_names",
    "source_of",
    "together",
]
