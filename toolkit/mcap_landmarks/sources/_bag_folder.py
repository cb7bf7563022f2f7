"""Which files of a folder are the parts of a ROS 2 bag: what is there counts more than what its metadata say."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.sources._bag_metadata import METADATA, metadata_beside
from mcap_landmarks.sources._shape import BagDescription

SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")


@dataclass(slots=True)
class BagFiles:
    """What a folder says about its files. messages: as metadata.yaml counts them, None if it lists other files."""

    files: list[Path]
    about: BagDescription
    messages: int | None = None
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def storage_files(folder: Path) -> list[Path]:
    """Storage files of a folder in the order of their numbers; a compressed one counts only alone."""
    found = [path for path in folder.iterdir() if path.name.endswith(SUFFIXES) and path.is_file()]
    names = {path.name for path in found}
    return sorted((path for path in found if path.name.removesuffix(".zstd") not in names - {path.name}), key=_number)


def _number(path: Path) -> tuple[int, str, int]:
    stem, _, number = path.name.split(".")[0].rpartition("_")
    return (0, stem, int(number)) if number.isdecimal() else (1, path.name, 0)


def single_file(path: Path) -> BagFiles:
    """One storage file, with what the metadata beside it say if they are of it."""
    about = metadata_beside(path.parent / METADATA)
    return BagFiles([path], about if about and path.name in about.files else BagDescription())


def files_of(path: Path) -> BagFiles:
    """The files of a bag; what is there counts more than what its metadata say, unless it is of another bag.

    Raises:
        RecordingError: no file is there.
    """
    about, present = metadata_beside(path / METADATA), storage_files(path)
    if not present:
        lacks = f"none of the files that {METADATA} lists" if about and about.files else "no storage file"
        raise RecordingError(f"{path} holds {lacks} (.db3 or .mcap); copy the bag again")
    if about and about.files:
        return _listed_files(path, about, present)
    why = "is damaged" if about is None else "lists no files" if (path / METADATA).exists() else "is missing"
    note = f"{path}: {METADATA} {why}; took all {len(present)} storage files"
    return BagFiles(present, about or BagDescription(), notes=[note])


def _listed_files(path: Path, about: BagDescription, present: Sequence[Path]) -> BagFiles:
    """The files of a bag whose metadata list them, and those that only continue their numbers."""
    by_name = {file.name.removesuffix(".zstd"): file for file in present}
    listed = _listed(about)
    missing = [name for name in listed if name not in by_name]
    if len(missing) == len(listed) <= len(present):  # they were renamed
        note = f"{path}: {METADATA} lists none of the {len(present)} storage files; took all of them"
        return BagFiles(list(present), about, notes=[note])
    losses = [f"{path}: {name}, a part of the bag, is missing" for name in missing]
    more, others = _unlisted(listed, [file for name, file in by_name.items() if name not in listed])
    notes = _notes(path, more, others)
    files = [file for file in present if file not in others]
    return BagFiles(files, about, None if more else about.messages, losses, notes)


def _listed(about: BagDescription) -> list[str]:
    """The files that metadata list, as if none were compressed; a name of another kind was cut."""
    return [name.removesuffix(".zstd") for name in about.files if name.endswith(SUFFIXES)]


def _notes(path: Path, more: Sequence[Path], others: Sequence[Path]) -> list[str]:
    taken = [f"{path}: {METADATA} does not list {file.name}, which was taken, too" for file in more]
    return taken + [f"{path}: {file.name} is no part of the bag, and was not taken" for file in others]


def _unlisted(listed: Sequence[str], unlisted: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Of files that metadata do not list those that continue the numbers of the listed ones, and the others."""
    series = {_number(Path(name))[:2] for name in listed}
    more = [file for file in unlisted if _number(file)[0] == 0 and _number(file)[:2] in series]
    return more, [file for file in unlisted if file not in more]
