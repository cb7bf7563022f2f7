"""ROS 2 bags: a folder of storage files, or a single one; SQLite is read here, MCAP named for who reads it."""

import contextlib
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import zstandard
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.sources._db3 import ZSTD_MAGIC, Db3Log
from mcap_landmarks.sources._mcap import carry
from mcap_landmarks.sources._ros2_types import check_distribution, known_distribution
from mcap_landmarks.sources._shape import Log, McapFile, Source, SourceLog

_SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
_MAGICS = (b"SQLite format 3\0", b"\x89MCAP0\r\n")
_METADATA = "metadata.yaml"


@dataclass(frozen=True, slots=True)
class Rosbag2Config:
    """distro: the distribution whose definitions are used where a bag has none of its own, such as humble."""

    distro: str | None = None


@dataclass(slots=True)
class _Folder:
    """What a folder says about its files."""

    files: list[Path]
    distribution: str | None = None
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def recognises(path: Path) -> bool:
    """A storage file, or a folder with such files or a metadata.yaml."""
    if path.is_dir():
        return (path / _METADATA).is_file() or bool(_storage_files(path))
    if path.name.endswith(_SUFFIXES):
        return True
    with path.open("rb") as stream:
        return stream.read(16).startswith(_MAGICS)


@contextlib.contextmanager
def open_bag(path: Path, config: Rosbag2Config) -> Iterator[Sequence[SourceLog]]:
    """The one log of a bag.

    Raises:
        RecordingError: a file cannot be read, or the folder does not say which files belong to the bag.
        UsageError: the distribution is unknown.
    """
    if config.distro:
        check_distribution(config.distro)
    folder = _folder(path) if path.is_dir() else _single(path)
    name = path.name if path.is_dir() else path.name.split(".")[0] if path.name.endswith(".zstd") else path.stem
    with contextlib.ExitStack() as stack:
        parts: list[Log | McapFile] = []
        size = 0
        for file in folder.files:
            plain = stack.enter_context(_plain(file))
            size += plain.stat().st_size
            parts.append(_part(plain, file, config.distro or folder.distribution))
        yield [SourceLog(name, tuple(parts), size, tuple(folder.losses), notes=tuple(folder.notes))]


def _part(plain: Path, file: Path, distribution: str | None) -> Log | McapFile:
    with plain.open("rb") as stream:
        start = stream.read(16)
    if not start:
        raise RecordingError(f"{file} is empty (0 bytes); record or copy it again")
    if start.startswith(_MAGICS[0]):
        return Db3Log(plain, distribution)
    if start.startswith(_MAGICS[1]):
        return McapFile(plain, carry)
    kind = "an SQLite" if ".db3" in file.name else "an MCAP"
    raise RecordingError(f"{file} is not {kind} file, whatever its name says; check or copy it again")


@contextlib.contextmanager
def _plain(file: Path) -> Iterator[Path]:
    """The file itself, or a temporary one without the compression around it or the half page at its end."""
    with file.open("rb") as stream:
        start = stream.read(18)
    size = file.stat().st_size
    if start.startswith(ZSTD_MAGIC):
        with _temporary(file, size, compressed=True) as plain, _plain(plain) as whole:
            yield whole
    elif start.startswith(_MAGICS[0]) and (half := size % _page_bytes(start)):
        # SQLite would fill a half page with zeros and give them out as data.
        with _temporary(file, size - half, compressed=False) as plain:
            yield plain
    else:
        yield file


def _page_bytes(header: bytes) -> int:
    """Page size from an SQLite file's header, where 1 stands for 64 KiB; 1 if that makes no sense."""
    size = int.from_bytes(header[16:18], "big")
    return 65536 if size == 1 else size if size.bit_count() == 1 else 1


@contextlib.contextmanager
def _temporary(file: Path, size: int, *, compressed: bool) -> Iterator[Path]:
    """A temporary copy of the first bytes of a file, decompressed if asked for."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / file.name.removesuffix(".zstd")
        try:
            with file.open("rb") as source, copy.open("wb") as target:
                if compressed:
                    shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(source), target)
                else:
                    shutil.copyfileobj(source, target)
                    target.truncate(size)
        except zstandard.ZstdError as error:
            raise RecordingError(f"{file} cannot be decompressed ({error}); copy it again") from error
        except OSError as error:
            where = tempfile.gettempdir()
            raise RecordingError(
                f"{file} cannot be unpacked into {where} ({error.strerror}); free space there"
            ) from error
        yield copy


def _storage_files(folder: Path) -> list[Path]:
    """Storage files of a folder in the order of their numbers; a compressed one counts only alone."""
    found = [path for path in folder.iterdir() if path.name.endswith(_SUFFIXES) and path.is_file()]
    names = {path.name for path in found}
    return sorted((path for path in found if path.name.removesuffix(".zstd") not in names - {path.name}), key=_number)


def _number(path: Path) -> tuple[int, str, int]:
    stem, _, number = path.name.split(".")[0].rpartition("_")
    return (0, stem, int(number)) if number.isdigit() else (1, path.name, 0)


def _single(path: Path) -> _Folder:
    about = _information(path.parent / _METADATA)
    listed = path.name in _listed(about)
    return _Folder([path], _distribution(about) if listed else None)


def _folder(path: Path) -> _Folder:
    about, present = _information(path / _METADATA), _storage_files(path)
    listed = _listed(about)
    if not listed:
        if not present:
            raise RecordingError(f"{path} holds no storage file (.db3 or .mcap); copy the bag again")
        why = f"{_METADATA} lists no files" if (path / _METADATA).exists() else f"there is no {_METADATA}"
        return _Folder(present, _distribution(about), notes=[f"{path}: {why}; took all {len(present)} storage files"])
    return _listed_files(path, about, listed, present)


def _listed_files(path: Path, about: Mapping[str, object], listed: Sequence[str], present: Sequence[Path]) -> _Folder:
    """The files of a bag whose metadata list them; none of its files may be there that they do not list."""
    by_name = {file.name.removesuffix(".zstd"): file for file in present}
    missing = [name for name in listed if name.removesuffix(".zstd") not in by_name]
    if len(missing) == len(listed):
        raise RecordingError(f"{path}: none of the files that {_METADATA} lists is there; copy the bag again")
    files = [by_name.pop(name.removesuffix(".zstd")) for name in listed if name not in missing]
    if by_name:
        names = ", ".join(sorted(file.name for file in by_name.values()))
        raise RecordingError(
            f"{path}: {_METADATA} does not list {names}; move it elsewhere, or name the files to convert one by one"
        )
    return _Folder(files, _distribution(about), [f"{path}: {name}, a part of the bag, is missing" for name in missing])


def _information(metadata: Path) -> Mapping[str, object]:
    """What a metadata.yaml says, nothing if it is missing or damaged."""
    try:
        document = YAML(typ="safe", pure=True).load(metadata.read_text())
    except (OSError, UnicodeDecodeError, YAMLError):
        return {}
    about = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    return about if isinstance(about, dict) else {}


def _listed(about: Mapping[str, object]) -> list[str]:
    names = about.get("relative_file_paths")
    return [PurePosixPath(str(name)).name for name in names] if isinstance(names, list) else []


def _distribution(about: Mapping[str, object]) -> str | None:
    name = str(about.get("ros_distro"))
    return name if known_distribution(name) else None


SOURCE = Source("rosbag2", "ROS 2 bags (folder, .db3, .mcap, also .zstd)", Rosbag2Config, recognises, open_bag)
