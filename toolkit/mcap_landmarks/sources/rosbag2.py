"""ROS 2 bags: a folder of storage files, or a single one; SQLite is read here, MCAP named for who reads it."""

import contextlib
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

import zstandard

from mcap_landmarks import memory
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import Location, size_of
from mcap_landmarks.sources._bag_folder import SUFFIXES, files_of, single_file, storage_files
from mcap_landmarks.sources._bag_metadata import METADATA
from mcap_landmarks.sources._db3 import ZSTD_MAGIC, Db3Log
from mcap_landmarks.sources._definition_files import DefinitionFiles
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources._mcap import carry
from mcap_landmarks.sources._ros2_types import check_distribution
from mcap_landmarks.sources._shape import Log, McapFile, Source, SourceLog

_SMALL_FILE = 1 << 30
"""So much may be unpacked from any file, into a temporary one: bags of still pictures shrink to a thousandth."""
_MAGICS = (b"SQLite format 3\0", b"\x89MCAP0\r\n")


@dataclass(frozen=True, slots=True)
class Rosbag2Config:
    """Where a bag has no definitions of its own. distro: the distribution that has them, such as humble. definitions:
    files and folders with them, which go before.
    """

    distro: str | None = None
    definitions: tuple[str, ...] = ()


def recognises(path: Path) -> bool:
    """A storage file, or a folder with such files or a metadata.yaml."""
    if path.is_dir():
        return (path / METADATA).is_file() or bool(storage_files(path))
    if path.name.endswith(SUFFIXES):
        return True
    with path.open("rb") as stream:
        return stream.read(16).startswith(_MAGICS)


@contextlib.contextmanager
def open_bag(path: Path, config: Rosbag2Config) -> Iterator[Sequence[SourceLog]]:
    """The one log of a bag.

    Raises:
        RecordingError: no file of it can be read.
        UsageError: the distribution is unknown, or there are no such definitions.
    """
    if config.distro:
        check_distribution(config.distro)
    folder = files_of(path) if path.is_dir() else single_file(path)
    name = path.name if path.is_dir() else path.name.split(".")[0] if path.name.endswith(".zstd") else path.stem
    distributions = [one for one in (config.distro, folder.about.distribution) if one]
    definitions = Definitions(DefinitionFiles(config.definitions), distributions)
    with contextlib.ExitStack() as stack:
        parts: list[Log | McapFile] = []
        problems: list[RecordingError] = []
        size = 0
        for file in folder.files:
            try:
                plain = stack.enter_context(_plain(file))
                parts.append(_part(plain, file, definitions))
            except RecordingError as error:
                problems.append(error)
                continue
            size += plain.stat().st_size
        if not parts:
            raise RecordingError("; ".join(map(str, problems)))
        losses = (*folder.losses, *map(str, problems))
        told = ((METADATA, folder.about), *(one.about for one in parts if isinstance(one, Db3Log)))
        notes = tuple(folder.notes)
        yield [SourceLog(name, tuple(parts), size, losses, notes=notes, told=told, messages=folder.messages)]


def recording_elsewhere(place: Location, config: Rosbag2Config) -> SourceLog:
    """The log that an MCAP file elsewhere is, which need not be copied; metadata beside it are not looked for.

    Raises:
        RemoteError: there is no such file, or it cannot be read.
        UsageError: as `open_bag`.
    """
    if config.distro:
        check_distribution(config.distro)
    definitions = Definitions(DefinitionFiles(config.definitions), [config.distro] if config.distro else [])
    return SourceLog(place.stem, (McapFile(place, partial(carry, definitions)),), size_of(place))


def _part(plain: Path, file: Path, definitions: Definitions) -> Log | McapFile:
    with plain.open("rb") as stream:
        start = stream.read(16)
        stream.seek(-min(8, stream.seek(0, 2)), 2)
        end = stream.read()
    if not start and file.stat().st_size:
        raise RecordingError(f"{file} is cut, and nothing of it can be decompressed; copy it again")
    if not start:
        raise RecordingError(f"{file} is empty (0 bytes); record or copy it again")
    if start.startswith(_MAGICS[0]):
        return Db3Log(plain, definitions, file)
    if start.startswith(_MAGICS[1]) or end == _MAGICS[1]:  # its first bytes may be what is damaged
        return McapFile(plain, partial(carry, definitions))
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
                    _unpack(zstandard.ZstdDecompressor().stream_reader(source), target, size)
                else:
                    shutil.copyfileobj(source, target)
                    target.truncate(size)
        except memory.TooLargeError as error:
            raise RecordingError(f"{file}: {error}; if that is right, allow it with --max-memory") from error
        except zstandard.ZstdError as error:
            raise RecordingError(f"{file} cannot be decompressed ({error}); copy it again") from error
        except OSError as error:
            where = tempfile.gettempdir()
            raise RecordingError(
                f"{file} cannot be unpacked into {where} ({error.strerror}); free space there"
            ) from error
        yield copy


def _unpack(source: zstandard.ZstdDecompressionReader, target: BinaryIO, size: int) -> None:
    """Copy what a decompressor makes of so many bytes, if that is in proportion to them; memory does not matter."""
    largest = memory.most(size, _SMALL_FILE)
    while piece := source.read(1 << 20):
        target.write(piece)
        if target.tell() > largest:
            raise memory.TooLargeError(f"it unpacks to more than {memory.shown(largest)}")


SOURCE = Source("rosbag2", "ROS 2 bags (folder, .db3, .mcap, also .zstd)", Rosbag2Config, recognises, open_bag)
