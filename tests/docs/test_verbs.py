"""The pages of the verbs say what `--help` says now."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_the_pages_of_the_verbs_are_those_that_the_script_writes() -> None:
    spec = importlib.util.spec_from_file_location("write_verbs", ROOT / "docs" / "verbs.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    expected = script.pages()
    assert {path.name for path in (ROOT / "docs" / "verbs").iterdir()} == set(expected)
    for name, text in expected.items():
        if (ROOT / "docs" / "verbs" / name).read_text() != text:
            pytest.fail(f"docs/verbs/{name} is not what --help says: run python docs/verbs.py")
