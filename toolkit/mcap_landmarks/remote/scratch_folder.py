"""A folder for copies that lasts as long as the process; those of killed processes go, too."""

import fcntl
import os
import shutil
import tempfile
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path

_PREFIX = "mcap-landmarks-copies-"
_LOCK = ".lock"


@cache
def scratch_folder() -> Path:
    """The folder of this process, in that for temporary files (TMPDIR). Removed when it ends, also as a worker.

    It is locked for as long as the process lives: one that nobody locks was left by a process that was killed.
    """
    parent = Path(tempfile.gettempdir())
    for left in parent.glob(f"{_PREFIX}*"):
        _remove_if_left(left)
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
    lock = os.open(folder / _LOCK, os.O_CREAT | os.O_WRONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    # Python's own `atexit` is passed over in worker processes of multiprocessing.
    Finalize(None, _remove, (folder, lock), exitpriority=0)
    return folder


def _remove(folder: Path, lock: int) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    os.close(lock)


def _remove_if_left(folder: Path) -> None:
    try:
        with (folder / _LOCK).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
    except OSError:  # it is in use, of another user, or just being made
        return
