"""The hashes of a conversion's inputs, found beside the conversion, which seldom has to wait for them."""

import contextlib
import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import Location, is_folder, to_read
from mcap_landmarks.manifest import file_hash
from mcap_landmarks.recording.reader import open_recording

HashOf = Callable[[Location], str]
"""Gives the hash of an input, or raises a ToolkitError: it cannot be read."""


class _LeftError(Exception):
    """Nobody waits for the hash any more."""


@contextlib.contextmanager
def input_hashes(places: Iterable[Location]) -> Iterator[HashOf]:
    """The hashes of files and folders; whoever asks for one waits until it is there. They end with the block.

    SHA-256 lets other threads of Python run, so that it takes no time of the conversion where there is a second core.
    """
    left = Event()

    def go_on(_read: int) -> None:
        if left.is_set():
            raise _LeftError

    files = {place: _files_of(place) for place in places}  # before an output can be among them
    with ThreadPoolExecutor(max_workers=1) as pool:
        hashes = {place: pool.submit(_content_hash, place, found, go_on) for place, found in files.items()}
        try:
            yield lambda place: hashes[place].result()
        finally:
            left.set()


def _files_of(place: Location) -> list[Path]:
    """The files of a folder; of one elsewhere, those of its copy."""
    return sorted(file for file in to_read(place).rglob("*") if file.is_file()) if is_folder(place) else []


def _content_hash(place: Location, files: Sequence[Path], progress: Callable[[int], None]) -> str:
    """SHA-256 of a file, or of the names and hashes of a folder's files; of a recording, over its CRCs.

    Raises:
        ToolkitError: a file cannot be read.
    """
    if place.suffix == ".mcap" and not files:
        with contextlib.suppress(RecordingError), open_recording(place) as recording:
            found = recording.content_hash()
            if found is not None:
                return found
    if not files and not is_folder(place):
        return file_hash(place, progress)
    folder = to_read(place)
    lines = [f"{file.relative_to(folder).as_posix()} {file_hash(file, progress)}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()
