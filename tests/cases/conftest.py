"""The inputs of the cases that this session's tests name, and the map that they are localized in."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cases.steps import RECORDINGS, cases_folder
from tests.cli.calls import call


@pytest.fixture(scope="session")
def case_input(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder with the input of a case, of those that a test's module lists in CASES."""
    script = cases_folder() / "make_cases.py"
    if not script.is_file():
        pytest.skip("no cases at ../shared/cases")
    modules = {item.module for item in request.session.items if isinstance(item, pytest.Function)}
    names = sorted({name for one in modules if one.__name__.startswith(__package__) for name in one.CASES})
    folder = tmp_path_factory.mktemp("cases")
    subprocess.run([sys.executable, script, RECORDINGS, folder, "--only", ",".join(names)], check=True)
    return lambda name: next(path.parent for path in folder.glob(f"{name}*"))


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The surveyed map of the demo."""
    path = tmp_path_factory.mktemp("site") / "site.db"
    assert call("map", RECORDINGS / "demo_map.mcap", "--from-reference", "--map", path) == 0
    return path
