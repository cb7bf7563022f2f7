"""docs/api.md runs as it stands there, and names what there is."""

import re
from pathlib import Path

import mcap_landmarks as ml
import pytest
from mcap_landmarks.api import log_tables
from mcap_landmarks.api.logged_items import LoggedCloud, LoggedImage, LoggedScan

from tests.docs.documents import DOCS, python_in

TEXT = (DOCS / "api.md").read_text()


@pytest.mark.slow
def test_the_blocks_run_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in python_in("api.md"):
        exec(compile(block, "docs/api.md", "exec"), names)  # noqa: S102 - that is what they are for
    said = capsys.readouterr().out
    assert "there is no /landmarks/match; run the stage that writes it first" in said
    assert (tmp_path / "map.csv").is_file()


def test_every_public_name_is_told() -> None:
    named = set(re.findall(r"\w+", TEXT))
    assert set(ml.__all__) - named == set()


def test_fields_are_those_of_the_tables() -> None:
    dtypes = {"detections": log_tables.DETECTION, "scene_objects": log_tables.SCENE_OBJECT, "matches": log_tables.MATCH}
    for method, dtype in dtypes.items():
        row = next(line for line in TEXT.splitlines() if line.startswith(f"| `{method}()`"))
        assert re.findall(r"`(\w+)`", row) == [*dtype.names[3:]], method
    for item in (LoggedImage, LoggedScan, LoggedCloud):
        row = next(line for line in TEXT.splitlines() if f"`{item.__name__}`" in line)
        assert all(hasattr(item, name) for name in re.findall(r"`(?!uint8|float32)(\w+)`", row)[1:]), item


def test_options_are_listed() -> None:
    line = next(line for line in TEXT.splitlines() if line.startswith("`config` `settings`"))
    assert re.findall(r"`(\w+)`", line) == list(ml.Options.__annotations__)
