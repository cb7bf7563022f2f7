"""Landmark maps and positions from robot recordings, offline and without ROS.

The names are loaded when they are asked for: the command has to heed signals before NumPy and the rest are there.
"""

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcap_landmarks.api.log_reader import LogReader, open_log
    from mcap_landmarks.api.logged_items import LoggedCloud, LoggedImage, LoggedScan
    from mcap_landmarks.api.pose_errors import EvaluationResult
    from mcap_landmarks.api.verb_calls import (
        Options,
        build_map,
        diff,
        diff_drives,
        diff_folders,
        evaluate,
        localize,
        run,
    )
    from mcap_landmarks.diff.comparison import Diff
    from mcap_landmarks.errors import (
        ExtensionError,
        LossWarning,
        MapError,
        MessageError,
        ModelError,
        RecordingError,
        RemoteError,
        ToolkitError,
        UsageError,
    )
    from mcap_landmarks.maps.model import LandmarkMap
    from mcap_landmarks.resources import example_log
    from mcap_landmarks.runs.map_results import MapRun
    from mcap_landmarks.runs.pipeline import LogRun
    from mcap_landmarks.structured import StructuredArray

__all__ = [
    "Diff",
    "EvaluationResult",
    "ExtensionError",
    "LandmarkMap",
    "LogReader",
    "LogRun",
    "LoggedCloud",
    "LoggedImage",
    "LoggedScan",
    "LossWarning",
    "MapError",
    "MapRun",
    "MessageError",
    "ModelError",
    "Options",
    "RecordingError",
    "RemoteError",
    "StructuredArray",
    "ToolkitError",
    "UsageError",
    "build_map",
    "diff",
    "diff_drives",
    "diff_folders",
    "evaluate",
    "example_log",
    "localize",
    "open_log",
    "run",
]

_MODULES = {
    "Diff": "diff.comparison",
    "EvaluationResult": "api.pose_errors",
    "LandmarkMap": "maps.model",
    "LogReader": "api.log_reader",
    "LogRun": "runs.pipeline",
    "LoggedCloud": "api.logged_items",
    "LoggedImage": "api.logged_items",
    "LoggedScan": "api.logged_items",
    "MapRun": "runs.map_results",
    "Options": "api.verb_calls",
    "StructuredArray": "structured",
    "build_map": "api.verb_calls",
    "diff": "api.verb_calls",
    "diff_drives": "api.verb_calls",
    "diff_folders": "api.verb_calls",
    "evaluate": "api.verb_calls",
    "example_log": "resources",
    "localize": "api.verb_calls",
    "open_log": "api.log_reader",
    "run": "api.verb_calls",
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

    class _Package(ModuleType):
        """The package itself: its `diff` is the function, also when the folder of that name has been imported."""

        def __setattr__(self, name: str, value: object) -> None:
            if not (name == "diff" and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

    sys.modules[__name__].__class__ = _Package
