"""A verb over many logs from the command line: outputs, documents, exit codes, wrong usage."""

import json
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.recording.reader import open_recording

from tests.cli.calls import call, schema_of
from tests.cli.logs import messages, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs, one that is cut, one that is none, and a map."""
    here = tmp_path_factory.mktemp("batch")
    (here / "logs").mkdir()
    write(here / "logs" / "a.mcap", messages(seed=1, count=60))
    whole = write(here / "logs" / "b.mcap", messages(seed=2, count=60)).read_bytes()
    (here / "logs" / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (here / "logs" / "none.mcap").write_text("no recording")
    assert call("map", here / "logs" / "a.mcap", "--map", here / "a.db") == 0
    return here


@pytest.mark.slow
def test_one_that_fails_does_not_stop_the_others(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--map", folder / "a.db", "--set", "localize.max_sigma_m=0.4", "-o", tmp_path / "out", "--workers", 2)
    capsys.readouterr()
    assert call("batch", "localize", folder / "logs" / "*.mcap", *words, "--json") == 3
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    jsonschema.validate(document, schema_of("batch"))
    assert [Path(log["log"]).stem for log in document["logs"]] == ["a", "b", "cut", "none"]
    assert [log["outcome"] for log in document["logs"]] == ["done", "done", "partial", "failed"]
    assert [log["exit_code"] for log in document["logs"]] == [0, 0, 3, 1]
    jsonschema.validate(document["logs"][1]["result"], schema_of("localize"))
    jsonschema.validate(document["logs"][3]["result"], schema_of("error"))
    assert "none.mcap is not an MCAP file" in printed.err
    assert "cut at byte" in printed.err
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.mcap", "b.mcap", "cut.mcap"]
    with open_recording(tmp_path / "out" / "b.mcap") as recording:
        assert "0.4" in recording.metadata["mcap-landmarks.run"]["config"]

    assert call("batch", "evaluate", tmp_path / "out" / "[ab].mcap", "--align", "-o", tmp_path / "figures") == 0
    assert "2 done" in capsys.readouterr().out
    jsonschema.validate(json.loads((tmp_path / "figures" / "a.json").read_text()), schema_of("evaluate"))
    again = ("batch", "evaluate", tmp_path / "out" / "a.mcap", "--align", "-o", tmp_path / "figures")
    assert call(*again) == 2
    assert "replace it with --overwrite" in capsys.readouterr().err
    assert call(*again, "--overwrite") == 0


@pytest.mark.slow
def test_all_failed(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("batch", "map", folder / "logs" / "none.mcap", "-o", tmp_path / "maps") == 1
    assert "1 failed" in capsys.readouterr().out
    assert list((tmp_path / "maps").iterdir()) == []


def test_wrong_usage_runs_nothing(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = folder / "logs" / "a.mcap", tmp_path / "out"
    for words, reason in (
        (("batch", "plot", log), "no such verb"),
        (("batch", "localize", log, "--mapp", "x.db"), "--mapp is no option of localize"),
        (("batch", "localize", log), "Missing option '--map'"),
        (("batch", "localize", "--map", "x.db"), "name the logs, a quoted pattern"),
        (("batch", "map", log, "--map", "x.db"), "--map names one file"),
        (("batch", "evaluate", tmp_path / "*.mcap"), "no file matches"),
    ):
        assert call(*words, "-o", out) == 2
        assert reason in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())
