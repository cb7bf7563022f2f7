"""The networks in the user's cache folder: where they lie, and which there are."""

import os
from pathlib import Path

import platformdirs

SUFFIX = ".onnx"


def folder() -> Path:
    """Where networks are kept, which need not be there: `models` in the cache folder of the program.

    That is what `MCAP_LANDMARKS_CACHE` says, else the one that the platform has for each program of a user.
    """
    own = os.environ.get("MCAP_LANDMARKS_CACHE")
    return (Path(own) if own else platformdirs.user_cache_path("mcap-landmarks", appauthor=False)) / "models"


def cached() -> dict[str, Path]:
    """The networks in the cache by name, those that the user put there included."""
    there = folder()
    return {path.stem: path for path in sorted(there.glob(f"*{SUFFIX}")) if path.is_file()}
