"""The detector families: one file each, of one shape; found by name, and imported when a model is opened."""

import importlib
import pkgutil

from mcap_landmarks.vision.family import Family


def family_names() -> tuple[str, ...]:
    """Every family in this folder; files whose name begins with an underscore are parts of families."""
    return tuple(sorted(entry.name for entry in pkgutil.iter_modules(__path__) if not entry.name.startswith("_")))


def find_family(name: str) -> Family:
    """The declaration of a family, imported now."""
    family = importlib.import_module(f"{__name__}.{name}").FAMILY
    assert isinstance(family, Family)  # noqa: S101 - a contract of this folder, held by tests/contract
    return family
