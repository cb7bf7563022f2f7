"""Foreign formats: one file each, of one shape, and those that packages bring; found by name, imported when asked."""

from pathlib import Path

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.extensions import Registry
from mcap_landmarks.sources._bag_metadata import recorded_metadata
from mcap_landmarks.sources._definition_files import definition_files
from mcap_landmarks.sources._foxglove_types import counterpart
from mcap_landmarks.sources._loss_account import Accounted, LossAccount, LostStretch
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

SOURCES: Registry[Source] = Registry(
    "source", "sources", "SOURCE", (Source,), "mcap_landmarks.sources", beside="stages"
)


def source_names() -> tuple[str, ...]:
    """Every source in this folder and of packages; files whose name begins with an underscore are parts of sources."""
    return SOURCES.names()


def find_source(name: str) -> Source:
    """The declaration of a source, imported now.

    Raises:
        ExtensionError: the package that brings it cannot be used.
    """
    return SOURCES.find(name)


def source_of(path: Path) -> Source:
    """The source that reads a path.

    Raises:
        RecordingError: there is nothing at the path, it may not be read, or no source knows it.
    """
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file or folder; check the path")
    known = [SOURCES.own(name) for name in SOURCES.usable()]
    try:
        for source in known:
            if source.recognises(path):
                return source
    except PermissionError as error:
        raise RecordingError(f"{path} may not be read; change its permissions") from error
    formats = "; ".join([*(source.reads for source in known), *SOURCES.problems()])
    raise RecordingError(f"{path} is nothing that can be converted; known are: {formats}")


__all__ = [
    "SOURCES",
    "Accounted",
    "BagDescription",
    "Carried",
    "Log",
    "LossAccount",
    "LostStretch",
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
