"""The stages: one file each, of one shape; found by name, and imported only when asked for."""

import importlib
import pkgutil

from mcap_landmarks.stage import Reduction, Stage


def stage_names() -> tuple[str, ...]:
    """Every stage in this folder; files whose name begins with an underscore are parts of stages."""
    return tuple(sorted(entry.name for entry in pkgutil.iter_modules(__path__) if not entry.name.startswith("_")))


def find_stage(name: str) -> Stage | Reduction:
    """The declaration of a stage, imported now."""
    stage = importlib.import_module(f"{__name__}.{name}").STAGE
    assert isinstance(stage, Stage | Reduction)  # noqa: S101 - a contract of this folder, held by tests/contract
    return stage
