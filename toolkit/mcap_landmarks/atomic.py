"""Output files and folders that appear whole or not at all, each written by one process at a time.

An output elsewhere is made in the user's cache folder, and sent when it is whole; see `remote.uploads`. Its lock keeps
other processes of this machine off: of two machines that write it, the one that is done last replaces what the other
has written.
"""

import contextlib
import errno
import fcntl
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TypeVar

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location, Url

_L = TypeVar("_L", bound=Location)
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}
"""What systems say whose files cannot be locked (flock(2), some network file systems)."""
_held: set[Path] = set()
"""The targets that this process holds."""


class HeldError(RecordingError):
    """Another process writes a target at this moment."""


def check_target(target: _L, *, is_folder: bool = False) -> _L:
    """The target; refuses one that cannot become a regular file, or a folder. A link stands for its end.

    Raises:
        UsageError: its folder does not exist, what has its name is something else, or nothing can be written there.
    """
    if isinstance(target, Url):
        from mcap_landmarks.remote.uploads import check_uploadable  # noqa: PLC0415 # not loaded for paths

        check_uploadable(target.text, is_folder=is_folder)
        return target
    path = _path(target)
    real = _real(path)
    if not real.parent.is_dir():
        raise UsageError(f"{path}: the folder {real.parent} does not exist; create it first")
    try:
        mode = real.lstat().st_mode
    except FileNotFoundError:
        return target
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from error
    if is_folder and not stat.S_ISDIR(mode):
        raise UsageError(f"{path} is not a folder; name one that may be written")
    if not is_folder and not stat.S_ISREG(mode):
        raise UsageError(f"{path} is not a regular file; name a file that may be written")
    return target


@contextlib.contextmanager
def held(target: Location, *, is_folder: bool = False) -> Iterator[Path]:
    """Keep every other process from writing a target while the block runs; the path where it is made.

    That is the one behind links, and of a target elsewhere one in the cache folder. The lock ends with the process,
    however that ends. What a killed process left half written is removed.

    Raises:
        UsageError: see `check_target`.
        HeldError: another process holds it.
        RecordingError: the disk is full, or the folder may not be written.
    """
    check_target(target, is_folder=is_folder)
    path = _staged(target) if isinstance(target, Url) else _real(_path(target))
    if path in _held:
        yield path
        return
    with _failing_as(target):
        descriptor = _lock(path, makes_folder=isinstance(target, Url))
    if descriptor is None:
        raise HeldError(f"{target}: another run writes to it; wait until that ends, or write to another file")
    _held.add(path)
    try:
        with _failing_as(target):
            _remove_left_over(path)
        yield path
    finally:
        _held.discard(path)
        with contextlib.suppress(OSError):
            _lock_file(path).unlink()  # while it is held, so that no other process holds what is removed
        os.close(descriptor)
        if isinstance(target, Url):
            with contextlib.suppress(OSError):
                path.parent.rmdir()


@contextlib.contextmanager
def atomic_file(target: Location) -> Iterator[BinaryIO]:
    """A file to write that takes the name `target` when the block ends well and vanishes when it does not.

    Raises:
        UsageError, RecordingError, RemoteError: see `atomic_path`.
    """
    with atomic_path(target) as partial, partial.open("xb") as stream:
        yield stream


@contextlib.contextmanager
def atomic_path(target: Location) -> Iterator[Path]:
    """The path of a file to make, which takes the name `target` when the block ends well and else vanishes.

    Raises:
        UsageError, RecordingError: see `held`.
        RemoteError: it cannot be sent; it is kept where the error says.
    """
    with held(target) as path, _failing_as(target):
        partial = _beside(path)
        try:
            yield partial
            with partial.open("rb") as stream:
                os.fsync(stream.fileno())
            if isinstance(target, Url):
                from mcap_landmarks.remote.staged_outputs import send_file  # noqa: PLC0415 # not loaded for paths

                send_file(partial, target.text)
            else:
                partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(target: Location) -> Iterator[Path]:
    """A folder to fill, which takes the place of `target` when the block ends well and else vanishes.

    Raises:
        UsageError, RecordingError, RemoteError: see `atomic_path`.
    """
    with held(target, is_folder=True) as path, _failing_as(target):
        partial, old = _beside(path), _beside(path)
        try:
            partial.mkdir()
            yield partial
            if isinstance(target, Url):
                from mcap_landmarks.remote.staged_outputs import send_folder  # noqa: PLC0415 # not loaded for paths

                send_folder(partial, target.text)
                return
            if path.exists():
                path.rename(old)
            try:
                partial.rename(path)
            except OSError:
                old.rename(path)
                raise
        finally:
            for folder in (partial, old):
                _remove(folder)


def _path(target: Location) -> Path:
    if isinstance(target, Path):
        return target
    raise TypeError(f"{target!r} is no location")


def _staged(target: Url) -> Path:
    from mcap_landmarks.remote.staged_outputs import staged_output  # noqa: PLC0415 # not loaded for paths

    return staged_output(target.text)


def _beside(path: Path) -> Path:
    """A hidden name that is free, and known for a left-over if it is not removed."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _lock_file(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _lock(path: Path, *, makes_folder: bool) -> int | None:
    """An open file that is locked for as long as it is open; None if another process has locked it."""
    name = _lock_file(path)
    while True:
        if makes_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = os.open(name, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        except FileNotFoundError:  # whoever made the folder before removed it after that
            if makes_folder:
                continue
            raise
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), name.stat()):
                return descriptor
        except BlockingIOError:
            os.close(descriptor)
            return None
        except FileNotFoundError:  # whoever held it removed it after it was opened here
            pass
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return descriptor
            os.close(descriptor)
            raise
        os.close(descriptor)


def _remove_left_over(path: Path) -> None:
    """Remove what processes left half written that were killed: who writes now holds the target."""
    left_over = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]{{8}}\.partial")
    for entry in list(path.parent.iterdir()):
        if left_over.fullmatch(entry.name):
            _remove(entry)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def _failing_as(target: Location) -> Iterator[None]:
    """Turn what the system says into one error."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        if isinstance(target, Url):
            folder = _staged(target).parent
            raise RecordingError(
                f"{target}: cannot be made in {folder} ({reason}); free space there, or let MCAP_LANDMARKS_CACHE name "
                "another folder"
            ) from error
        raise RecordingError(f"{target}: cannot be written ({reason}); free space or choose another place") from error
