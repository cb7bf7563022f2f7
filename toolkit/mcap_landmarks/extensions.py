"""Stages, detector families and sources by name: ours, a file each, and those of packages that others installed.

A package brings one by an entry point in the group of its kind, see docs/extending.md. What is wrong with it is an
error of whoever asks for it by its name, and of nobody else.
"""

import dataclasses
import hashlib
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Generic, TypeVar

from mcap_landmarks.errors import ExtensionError

_D_co = TypeVar("_D_co", covariant=True)
_PACKAGE = __name__.partition(".")[0]
_ROOT = Path(__file__).parent


@dataclasses.dataclass(frozen=True, slots=True)
class Registry(Generic[_D_co]):
    """The declarations of one kind, such as a stage.

    `folder` has ours, each in a file of its name as `attribute`, of one of the `types`. Packages bring theirs by the
    entry points of `group`. In a configuration they share their names with those of the folder `beside`.
    """

    what: str
    folder: str
    attribute: str
    types: tuple[type[_D_co], ...]
    group: str
    beside: str = ""

    def names(self) -> tuple[str, ...]:
        """All names, whether they can be loaded or not."""
        return tuple(sorted({*self._ours(), *(entry.name for entry in self.extensions())}))

    def find(self, name: str) -> _D_co:
        """The declaration of a name, imported now.

        Raises:
            ExtensionError: the package that brings it cannot be used.
        """
        entries = [entry for entry in self.extensions() if entry.name == name]
        taken = name in self._ours() or (self.beside and name in _files_in([str(_ROOT / self.beside)]))
        if taken and entries:
            raise ExtensionError(f"{_told(entries[0])}: there is a {name} of ours; {_REMEDY}")
        if len(entries) > 1:
            raise ExtensionError(f"{' and '.join(map(_told, entries))}: both are called {name}; uninstall one of them")
        return self._load(entries[0]) if entries else self._import(name)

    def usable(self) -> tuple[str, ...]:
        """The names of those that can be loaded: all of ours, and of those that packages bring."""
        return tuple(name for name in self.names() if name in self._ours() or self._problem(name) is None)

    def own(self, name: str) -> _D_co:
        """The declaration of ours, or else what `find` gives; for who looks at all that is usable."""
        return self._import(name) if name in self._ours() else self.find(name)

    def problems(self) -> list[str]:
        """What is wrong with packages, in words."""
        found = (self._problem(name) for name in dict.fromkeys(entry.name for entry in self.extensions()))
        return [problem for problem in found if problem is not None]

    def extensions(self) -> tuple[EntryPoint, ...]:
        """The entry points of packages."""
        return _entries(self.group)

    def code(self, name: str | None = None) -> str:
        """A hash over the package that brings what has a name, or over all packages; empty where there is none."""
        found = [_code(entry) for entry in self.extensions() if name in {None, entry.name}]
        return hashlib.sha256("".join(sorted(found)).encode()).hexdigest() if found else ""

    def _ours(self) -> tuple[str, ...]:
        return _files_in(importlib.import_module(self._package).__path__)

    @property
    def _package(self) -> str:
        return f"{_PACKAGE}.{self.folder.replace('/', '.')}"

    def _import(self, name: str) -> _D_co:
        made = getattr(importlib.import_module(f"{self._package}.{name}"), self.attribute)
        assert isinstance(made, self.types)  # noqa: S101 - a contract of the folder, held by tests/contract
        return made

    def _load(self, entry: EntryPoint) -> _D_co:
        try:
            made = entry.load()
        except (Exception, SystemExit) as error:
            raise ExtensionError(
                f"{_told(entry)} cannot be loaded ({type(error).__name__}: {error}); {_REMEDY}"
            ) from error
        if not isinstance(made, self.types):
            raise ExtensionError(f"{_told(entry)} is of type {type(made).__name__} and no {self.what}; {_REMEDY}")
        if getattr(made, "name", entry.name) != entry.name:
            raise ExtensionError(f"{_told(entry)} calls itself {getattr(made, 'name', '')!r}; {_REMEDY}")
        _check_config(entry, getattr(made, "config", None))
        return made

    def _problem(self, name: str) -> str | None:
        try:
            self.find(name)
        except ExtensionError as error:
            return str(error)
        return None


def names_in(group: str) -> list[str]:
    """The names of what packages bring in a group."""
    return [entry.name for entry in _entries(group)]


_REMEDY = "repair or uninstall the package"


def _check_config(entry: EntryPoint, config: object) -> None:
    """Refuse a configuration that is no dataclass whose fields all have defaults."""
    if config is None:
        return
    if not (isinstance(config, type) and dataclasses.is_dataclass(config)):
        raise ExtensionError(f"{_told(entry)} has a configuration that is no dataclass; {_REMEDY}")
    for field in dataclasses.fields(config):
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise ExtensionError(f"{_told(entry)} has a setting without a default, {field.name}; {_REMEDY}")


def _files_in(folders: Iterable[str]) -> tuple[str, ...]:
    """The names in folders of ours; files whose name begins with an underscore are parts of others."""
    return tuple(sorted(entry.name for entry in pkgutil.iter_modules(folders) if not entry.name.startswith("_")))


@cache
def _entries(group: str) -> tuple[EntryPoint, ...]:
    return tuple(sorted(entry_points(group=group), key=_told))


def _told(entry: EntryPoint) -> str:
    """An entry point in words."""
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "a package without a name"
    return f"the entry point {entry.name} = {entry.value} ({entry.group}) of {package}"


@cache
def _code(entry: EntryPoint) -> str:
    """A hash over the package of an entry point: its name and version, and the content of its files."""
    digest = hashlib.sha256(_told(entry).encode())
    for path, name in _files(entry):
        content = path.read_bytes() if path.is_file() else b""
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _files(entry: EntryPoint) -> Iterator[tuple[Path, str]]:
    """The files of a package, with their names in it: those that its installer lists, else those around its module.

    Of a package that is installed to be edited the installer lists none.
    """
    top = entry.module.partition(".")[0]
    listed = sorted(file for file in (entry.dist and entry.dist.files) or () if _is_content(file.parts))
    if any(file.parts[0] in {top, f"{top}.py"} for file in listed):
        return ((Path(str(file.locate())), file.as_posix()) for file in listed)
    return _files_of_module(top)


def _files_of_module(top: str) -> Iterator[tuple[Path, str]]:
    """The files of the module that a package is."""
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        spec = None
    if spec is None:  # it cannot be loaded either, and whoever asks for it is told
        return iter(())
    if spec.submodule_search_locations is None:
        return iter([(Path(spec.origin or ""), f"{top}.py")])
    return _files_below(map(Path, spec.submodule_search_locations))


def _files_below(folders: Iterable[Path]) -> Iterator[tuple[Path, str]]:
    """The files in folders of a package, with their names in it."""
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder)
            if path.is_file() and _is_content(name.parts):
                yield path, name.as_posix()


def _is_content(parts: tuple[str, ...]) -> bool:
    """Whether a file belongs to what a package is, and not to where and how it is installed."""
    return ".." not in parts and "__pycache__" not in parts and not any(part.endswith(".dist-info") for part in parts)
