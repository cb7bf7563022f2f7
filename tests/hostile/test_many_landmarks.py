"""Maps of more landmarks than there is memory for are refused, with what allows them."""

from pathlib import Path

import pytest
from mcap_landmarks import memory

from tests.cli.calls import call, refused


def test_a_map_takes_no_more_memory_than_is_allowed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, database = tmp_path / "many.csv", tmp_path / "many.db"
    file.write_text("id,class,x_m,y_m\n" + "".join(f"l{i},person,{i},0\n" for i in range(400)))
    try:
        said = refused(capsys, 1, "landmarks", "import", database, file, "--max-memory", "1M")
        assert said.endswith("landmarks take 1.6 MB as objects; if that is right, allow it with --max-memory")
        assert call("landmarks", "import", database, file, "--max-memory", "2M") == 0
        assert "400 landmarks take" in refused(capsys, 1, "landmarks", "show", database, "--max-memory", "1M")
    finally:
        memory.allow(None)
