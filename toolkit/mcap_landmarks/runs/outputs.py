"""Names of output files: the one that the user gave, or one per input in a folder."""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location, Url

BAGS = frozenset({".bag", ".db3"})
"""Suffixes of what only `convert` makes."""


def names_folder(output: Location) -> bool:
    """Whether an output is a folder: one that is there, or a URL with a slash at its end."""
    return output.text.endswith("/") if isinstance(output, Url) else isinstance(output, Path) and output.is_dir()


def check_recording(target: Location) -> Location:
    """The target of a recording, see `check_target`; nobody opens an MCAP file that is called a bag.

    Raises:
        UsageError: the name is that of a bag, or the target cannot be written.
    """
    if target.suffix.lower() in BAGS:
        raise UsageError(f"{target}: the output is an MCAP file; name it {target.stem}.mcap")
    return check_target(target)


def output_files(inputs: Sequence[Location], output: Location) -> dict[Location, Location]:
    """Output file by input: `output` itself for one input, else files of the inputs' names in the folder `output`.

    The folder is made if its parent exists. A single input goes into `output` too if that is a folder.

    Raises:
        UsageError: two inputs would write the same file, the name is that of a bag, or the target cannot be written.
    """
    if len(inputs) == 1 and not names_folder(output):
        return {inputs[0]: check_recording(output)}
    folder = make_folder(output)
    files: dict[Location, Location] = {}
    for log in inputs:
        target = folder / f"{log.stem}.mcap"
        if target in files.values():
            raise UsageError(f"{log}: another input also writes {target}; rename one, or run them apart")
        files[log] = check_target(target)
    return files


def make_folder(folder: Location) -> Location:
    """Make a folder whose parent exists; of a URL there is nothing to make.

    Raises:
        UsageError: the parent does not exist, the name belongs to a file, or nothing can be written there.
        RecordingError: it may not be made there.
    """
    if not isinstance(folder, Path):
        return check_target(folder, is_folder=True)
    if not folder.parent.is_dir():
        raise UsageError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; several outputs need a folder")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"{folder}: cannot be made ({reason}); choose another place with -o") from error
    return folder


@contextlib.contextmanager
def no_empty_folder(place: Location) -> Iterator[None]:
    """Take a folder away again that was made in the block, if the block fails and it holds nothing."""
    if not isinstance(place, Path):
        yield
        return
    folder, is_new, is_whole = place, not place.exists(), False
    try:
        yield
        is_whole = True
    finally:
        if is_new and not is_whole and folder.is_dir():
            with contextlib.suppress(OSError):
                folder.rmdir()
