"""Scenarios and simulated robots that several tests share."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap_landmarks_generator.checks import Staged, stage
from mcap_landmarks_generator.loading import load_scenario

StageText = Callable[[str], Staged]


@pytest.fixture
def stage_text(tmp_path: Path) -> StageText:
    """Stages a scenario given as TOML text."""

    def staged(text: str) -> Staged:
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return stage(load_scenario(str(path)))

    return staged
