"""The fuzzing targets take the inputs that fuzzing begins with, so that it starts from what is read to its end."""

from pathlib import Path

import pytest

from tests.fuzz.corpus import seeds
from tests.fuzz.targets import TARGETS


@pytest.mark.slow
def test_every_target_reads_its_inputs(tmp_path: Path) -> None:
    reached = set()
    for target, content in seeds():
        TARGETS[target](content, tmp_path)
        reached.add(target)
    assert reached == TARGETS.keys()
