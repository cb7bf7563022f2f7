"""A log that is cut before its topics: who looks for them says that, not only that they are not there."""

from pathlib import Path

import pytest

from tests.cli.calls import call
from tests.cli.logs import messages, write

MAP_DB = Path(__file__).parents[1] / "golden" / "map.db"


def test_a_log_that_is_cut_is_told_with_the_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, log = write(tmp_path / "whole.mcap", messages()), tmp_path / "cut.mcap"
    log.write_bytes(whole.read_bytes()[:400])
    for words in (("localize", log, "--map", MAP_DB), ("cluster", log), ("map", log, "--map", tmp_path / "m.db")):
        more = () if words[0] == "map" else ("-o", tmp_path / "out.mcap")
        assert call(*words, *more) == 1
        said = capsys.readouterr().err
        assert "not all of the file could be read (the file is cut at byte" in said
        assert f"mcap-landmarks recover {log} -o OUT.mcap" in said
