"""Landmark maps and positions from robot recordings, offline and without ROS.

The names are loaded when they are asked for: the command has to heed signals before NumPy and the rest are there.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcap_landmarks.api.log_reader import LogReader, open_log
    from mcap_landmarks.api.logged_items import LoggedCloud, LoggedImage, LoggedScan
    from mcap_landmarks.errors import (
        ExtensionError,
        LossWarning,
        MapError,
        MessageError,
        ModelError,
        RecordingError,
        ToolkitError,
        UsageError,
    )
    from mcap_landmarks.maps.model import LandmarkMap
    from mcap_landmarks.structured import StructuredArray

__all__ = [
    "ExtensionError",
    "LandmarkMap",
    "LogReader",
    "LoggedCloud",
    "LoggedImage",
    "LoggedScan",
    "LossWarning",
    "MapError",
    "MessageError",
    "ModelError",
    "RecordingError",
    "StructuredArray",
    "ToolkitError",
    "UsageError",
    "open_log",
]

_MODULES = {
    "LandmarkMap": "maps.model",
    "LogReader": "api.log_reader",
    "LoggedCloud": "api.logged_items",
    "LoggedImage": "api.logged_items",
    "LoggedScan": "api.logged_items",
    "StructuredArray": "structured",
    "open_log": "api.log_reader",
}
"""Where the public names are; the others are errors."""
__version__: str

if not TYPE_CHECKING:  # which would take every name for one of ours

    def __getattr__(name: str) -> object:
        """A public name, or the version, when it is asked for."""
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415 - as said above

            return version("mcap-landmarks")
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f"{__name__}.{_MODULES.get(name, 'errors')}"), name)

    def __dir__() -> list[str]:
        return sorted([*globals(), *__all__])
