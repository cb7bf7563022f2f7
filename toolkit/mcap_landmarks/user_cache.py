"""The program's folder in the cache of its user."""

import os
from pathlib import Path


def user_cache() -> Path:
    """The folder, which need not be there: what `MCAP_LANDMARKS_CACHE` says, else that of the platform."""
    if own := os.environ.get("MCAP_LANDMARKS_CACHE"):
        return Path(own)
    import platformdirs  # noqa: PLC0415 - only where it is needed

    return platformdirs.user_cache_path("mcap-landmarks", appauthor=False)
