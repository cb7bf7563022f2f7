"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the data that others made; tests that need it are skipped where it is missing."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    path = Path(os.environ.get("MCAP_LANDMARKS_DATA", default))
    if not path.is_dir():
        pytest.skip(f"no data at {path}; set MCAP_LANDMARKS_DATA")
    return path
