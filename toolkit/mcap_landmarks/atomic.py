"""Output files that appear whole or not at all."""

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap_landmarks.errors import RecordingError, UsageError


def check_target(path: Path) -> None:
    """Refuse a target that cannot become a regular file.

    Raises:
        UsageError: its folder does not exist, or something that is no regular file has its name.
    """
    if not path.parent.is_dir():
        raise UsageError(f"{path}: the folder {path.parent} does not exist; create it first")
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise UsageError(f"{path} is not a regular file; name a file that may be written")


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write that takes the name `path` when the block ends well and vanishes when it does not.

    Raises:
        UsageError: see `check_target`.
        RecordingError: the disk is full, or the folder may not be written.
    """
    check_target(path)
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"{path}: cannot be written ({reason}); free space or choose another place") from error
    finally:
        partial.unlink(missing_ok=True)
