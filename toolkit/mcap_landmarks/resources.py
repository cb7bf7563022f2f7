"""Finds the files that travel with the code (schemas, demo recordings), in a wheel and in a checkout."""

from pathlib import Path

from mcap_landmarks.errors import ToolkitError, UsageError

_PACKAGE = Path(__file__).resolve().parent
_EXAMPLES = ("demo_map", "demo_localize")


def resource(folder: str, name: str) -> Path:
    """Path of `folder/name`, where folder is `schemas` or `recordings`.

    A wheel carries these folders inside the package (`mcap_landmarks/data`), a checkout beside it.

    Raises:
        ToolkitError: the file is in neither place.
    """
    for root in (_PACKAGE / "data", _PACKAGE.parents[1]):
        path = root / folder / name
        if path.exists():
            return path
    raise ToolkitError(f"{folder}/{name} is missing from the installation; reinstall mcap-landmarks")


def detector() -> Path:
    """Path of the detector that detects when the user names no other.

    Raises:
        ToolkitError: this installation has none.
    """
    path = _PACKAGE / "vision" / "detector.onnx"
    if path.exists():
        return path
    raise ToolkitError(f"{path.name} is missing from the installation; reinstall mcap-landmarks, or give --model FILE")


def example_log(name: str) -> Path:
    """A small recording that comes with the toolkit, `demo_map` or `demo_localize`: two drives through one place.

    Raises:
        UsageError: there is none of this name.
    """
    if name not in _EXAMPLES:
        raise UsageError(f"{name} is no log that comes with the toolkit; there are {' and '.join(_EXAMPLES)}")
    return resource("recordings", f"{name}.mcap")
