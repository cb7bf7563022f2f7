"""CONTRIBUTING.md and the glossary name what is there, and show short ways through the code."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()
WAYS = re.split(r"^\*\*One ", CONTRIBUTING, flags=re.MULTILINE)[1:]
NAMES = re.findall(r"`([a-z]\w*(?:\.\w+)+)`", "".join(WAYS))
TERMS = re.findall(r"\(`([a-z]\w*(?:\.\w+)*)`\)", (ROOT / "docs" / "glossary.md").read_text())


def resolved(name: str) -> object:
    """A module, or what a module holds, by its name within the package."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(["mcap_landmarks", *parts[:count]]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            found = getattr(found, part)
        return found
    raise ModuleNotFoundError(name)


def test_an_image_a_scan_a_fleet_and_a_setting_take_at_most_eight_hops() -> None:
    assert [way.split("**")[0] for way in WAYS] == ["image", "scan", "fleet", "setting"]
    for way in WAYS:
        assert [int(number) for number in re.findall(r"^(\d)\. ", way, re.MULTILINE)][-1] <= 8


@pytest.mark.parametrize("name", sorted({*NAMES, *TERMS}))
def test_what_is_named_is_there(name: str) -> None:
    assert resolved(name) is not None
