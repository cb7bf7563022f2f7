"""Output files that appear whole or not at all."""

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location, to_write


def check_target(target: Location) -> Path:
    """The path of a target; refuses one that cannot become a regular file.

    Raises:
        UsageError: it is not on this machine, its folder does not exist, or what has its name is no regular file.
    """
    path = to_write(target)
    if not path.parent.is_dir():
        raise UsageError(f"{path}: the folder {path.parent} does not exist; create it first")
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise UsageError(f"{path} is not a regular file; name a file that may be written")
    return path


@contextlib.contextmanager
def atomic_file(target: Location) -> Iterator[BinaryIO]:
    """A file to write that takes the name `target` when the block ends well and vanishes when it does not.

    Raises:
        UsageError: see `check_target`.
        RecordingError: the disk is full, or the folder may not be written.
    """
    path = check_target(target)
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
