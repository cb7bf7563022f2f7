"""The public names: small in number, quick to import, typed, and each of them there."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import mcap_landmarks as ml
import pytest
from mcap_landmarks import errors

TREE = ast.parse(Path(ml.__file__).read_text())


def test_the_names_for_checkers_are_those_that_are_loaded() -> None:
    imported = {alias.name for node in ast.walk(TREE) if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert imported - {"TYPE_CHECKING", "ModuleType", "version"} == set(ml.__all__)
    assert list(ml.__all__) == sorted(ml.__all__, key=lambda name: (not name[0].isupper(), name))
    for name in ml.__all__:
        assert getattr(ml, name) is not None
    assert set(ml.__all__) <= set(dir(ml))
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        assert ml.nothing


def test_every_error_is_public() -> None:
    """Those of `errors`; what a package of ours derives from one for itself is caught as that."""
    tree = {
        name for name, one in vars(errors).items() if isinstance(one, type) and issubclass(one, Exception | Warning)
    }
    assert tree <= set(ml.__all__)


def test_importing_the_package_loads_nothing() -> None:
    asked = (
        "import sys, mcap_landmarks; print([name for name in ('numpy', 'importlib.metadata') if name in sys.modules])"
    )
    shown = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_logs_come_with_the_toolkit() -> None:
    assert ml.example_log("demo_map").is_file()
    with pytest.raises(ml.UsageError, match="there are demo_map and demo_localize"):
        ml.example_log("demo")


def test_images_are_bounded_as_for_the_command_line() -> None:
    asked = "import os, mcap_landmarks.api; print(os.environ['OPENCV_IO_MAX_IMAGE_PIXELS'])"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OPENCV")}
    shown = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, env=environment)
    assert int(shown.stdout) == 1 << 26
