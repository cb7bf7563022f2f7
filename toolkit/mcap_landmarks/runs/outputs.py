"""Names of output files: the one that the user gave, or one per input in a folder."""

from collections.abc import Sequence
from pathlib import Path

from mcap_landmarks.atomic import check_target
from mcap_landmarks.errors import RecordingError, UsageError


def output_files(inputs: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Output file by input: `output` itself for one input, else files of the inputs' names in the folder `output`.

    The folder is made if its parent exists. A single input goes into `output` too if that is a folder.

    Raises:
        UsageError: two inputs would write the same file, or the target cannot be written.
    """
    if len(inputs) == 1 and not output.is_dir():
        check_target(output)
        return {inputs[0]: output}
    make_folder(output)
    files: dict[Path, Path] = {}
    for path in inputs:
        target = output / f"{path.stem}.mcap"
        if target in files.values():
            raise UsageError(f"{path}: another input also writes {target}; rename one, or run them apart")
        check_target(target)
        files[path] = target
    return files


def make_folder(folder: Path) -> None:
    """Make a folder whose parent exists.

    Raises:
        UsageError: the parent does not exist, or the name belongs to a file.
        RecordingError: it may not be made there.
    """
    if not folder.parent.is_dir():
        raise UsageError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; several outputs need a folder")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"{folder}: cannot be made ({reason}); choose another place with -o") from error
