"""Fixtures that every test may use."""

from pathlib import Path

import pytest
from hypothesis import settings

from tests.shared import data_folder

# The same examples on every run and machine: a red test is a change, not luck.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write the results in tests/golden/ anew")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests on real data take minutes, so they come first: in parallel runs the others fill the time beside them."""
    items.sort(key=lambda item: "real" not in item.path.parts)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the data that others made; tests that need it are skipped where it is missing."""
    path = data_folder()
    if path is None:
        pytest.skip("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    return path
