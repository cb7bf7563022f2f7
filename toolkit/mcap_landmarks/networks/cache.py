"""The networks in the user's cache folder: where they lie, and which there are."""

from pathlib import Path

from mcap_landmarks.user_cache import user_cache

SUFFIX = ".onnx"


def folder() -> Path:
    """Where networks are kept, which need not be there."""
    return user_cache() / "models"


def cached() -> dict[str, Path]:
    """The networks in the cache by name, those that the user put there included."""
    there = folder()
    return {path.stem: path for path in sorted(there.glob(f"*{SUFFIX}")) if path.is_file()}
