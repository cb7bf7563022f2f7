"""The hashes of a conversion's inputs, found beside the conversion, which seldom has to wait for them."""

import contextlib
import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.manifest import file_hash
from mcap_landmarks.recording.reader import open_recording

HashOf = Callable[[Path], str]
"""Gives the hash of an input, or raises a ToolkitError: it cannot be read."""


class _LeftError(Exception):
    """Nobody waits for the hash any more."""


@contextlib.contextmanager
def input_hashes(paths: Iterable[Path]) -> Iterator[HashOf]:
    """The hashes of files and folders; whoever asks for one waits until it is there. They end with the block.

    SHA-256 lets other threads of Python run, so that it takes no time of the conversion where there is a second core.
    """
    left = Event()

    def go_on(_read: int) -> None:
        if left.is_set():
            raise _LeftError

    files = {path: _files_of(path) for path in paths}  # before an output can be among them
    with ThreadPoolExecutor(max_workers=1) as pool:
        hashes = {path: pool.submit(_content_hash, path, found, go_on) for path, found in files.items()}
        try:
            yield lambda path: hashes[path].result()
        finally:
            left.set()


def _files_of(path: Path) -> list[Path]:
    """The files of a folder."""
    return [] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())


def _content_hash(path: Path, files: Sequence[Path], progress: Callable[[int], None]) -> str:
    """SHA-256 of a file, or of the names and hashes of a folder's files; of a recording, over its CRCs.

    Raises:
        ToolkitError: a file cannot be read.
    """
    if path.suffix == ".mcap" and path.is_file():
        with contextlib.suppress(RecordingError), open_recording(path) as recording:
            found = recording.content_hash()
            if found is not None:
                return found
    if path.is_file():
        return file_hash(path, progress)
    lines = [f"{file.relative_to(path).as_posix()} {file_hash(file, progress)}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()
