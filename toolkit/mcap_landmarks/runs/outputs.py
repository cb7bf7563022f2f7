"""Names of output files: the one that the user gave, or one per input in a folder."""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location, to_write


def output_files(inputs: Sequence[Location], output: Location) -> dict[Location, Path]:
    """Output file by input: `output` itself for one input, else files of the inputs' names in the folder `output`.

    The folder is made if its parent exists. A single input goes into `output` too if that is a folder.

    Raises:
        UsageError: two inputs would write the same file, or the target cannot be written.
    """
    if len(inputs) == 1 and not to_write(output).is_dir():
        return {inputs[0]: check_target(output)}
    folder = make_folder(output)
    files: dict[Location, Path] = {}
    for log in inputs:
        target = folder / f"{log.stem}.mcap"
        if target in files.values():
            raise UsageError(f"{log}: another input also writes {target}; rename one, or run them apart")
        files[log] = check_target(target)
    return files


def make_folder(place: Location) -> Path:
    """Make a folder whose parent exists; its path.

    Raises:
        UsageError: it is not on this machine, the parent does not exist, or the name belongs to a file.
        RecordingError: it may not be made there.
    """
    folder = to_write(place)
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
    folder = to_write(place)
    is_new, is_whole = not folder.exists(), False
    try:
        yield
        is_whole = True
    finally:
        if is_new and not is_whole and folder.is_dir():
            with contextlib.suppress(OSError):
                folder.rmdir()
