"""The scenarios that come with the generator."""

import tomllib
from pathlib import Path

FOLDER = Path(__file__).parent / "scenarios"


def bundled() -> dict[str, str]:
    """Names of the bundled scenarios and their descriptions."""
    return {
        path.stem: str(tomllib.loads(path.read_text()).get("description", "")) for path in sorted(FOLDER.glob("*.toml"))
    }
