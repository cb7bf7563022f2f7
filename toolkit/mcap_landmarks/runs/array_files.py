"""Dataclasses of arrays and numbers as one file, for what goes from one process to another."""

import contextlib
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.atomic import atomic_file

T = TypeVar("T")
Arrays = Mapping[str, NDArray[Any]]


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write arrays by name, whole or not at all."""
    with atomic_file(path) as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def read_arrays(path: Path) -> dict[str, NDArray[Any]] | None:
    """What `write_arrays` wrote; None where there is nothing, or it is damaged."""
    if not path.is_file():
        return None
    broken = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)
    with contextlib.suppress(*broken), path.open("rb") as stream, np.load(stream, allow_pickle=False) as found:
        return dict(found)
    return None


def as_arrays(prefix: str, value: object) -> Iterator[tuple[str, NDArray[Any]]]:
    """The fields of a dataclass, those of dataclasses in it included, by names that begin with a prefix."""
    if is_dataclass(value):
        for entry in fields(value):
            yield from as_arrays(f"{prefix}.{entry.name}", getattr(value, entry.name))
    else:
        yield prefix, np.asarray(value)


def from_arrays(prefix: str, kind: type[T], arrays: Arrays) -> T:
    """The dataclass of a kind whose fields `as_arrays` gave."""
    if is_dataclass(kind):
        hints, names = get_type_hints(kind), [entry.name for entry in fields(kind)]
        return kind(**{name: from_arrays(f"{prefix}.{name}", hints[name], arrays) for name in names})
    value = arrays[prefix]
    return value.item() if kind in {bool, int, float} else value  # type: ignore[return-value] # an array is one
