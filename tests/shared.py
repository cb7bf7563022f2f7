"""Where the data that others made lies."""

import os
from pathlib import Path


def data_folder() -> Path | None:
    """`MCAP_LANDMARKS_DATA`, or `../shared/data` beside the project; None where there is no such folder."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    path = Path(os.environ.get("MCAP_LANDMARKS_DATA", default))
    return path if path.is_dir() else None
