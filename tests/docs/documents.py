"""Files and lines of code that stand in documents."""

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
_FILE = re.compile(r"^`([\w./-]+)`:\n\n```\w+\n(.*?)^```", re.DOTALL | re.MULTILINE)
_PYTHON = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def files_in(document: str) -> dict[str, str]:
    """The files that a document shows, each below its name."""
    return dict(_FILE.findall((DOCS / document).read_text()))


def python_in(document: str) -> list[str]:
    """The blocks of Python of a document."""
    return _PYTHON.findall((DOCS / document).read_text())
