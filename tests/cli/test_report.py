"""The verb report: what it writes and prints, without a browser."""

import json
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.catalogue.catalogue_file import append_rows
from mcap_landmarks.channels import TRUTH_POSE

from tests.catalogue.rows import row
from tests.cli.calls import call, refused, schema_of
from tests.diff.recordings import localized_log, localized_messages, write

APPENDIX_D = Path(__file__).parents[1] / "data" / "thesis_appendix_d.txt"
MAP_DB = Path(__file__).parents[1] / "golden" / "map.db"


def test_the_same_bytes_and_a_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, page = localized_log(tmp_path / "r.mcap"), tmp_path / "r.html"
    assert call("report", log, "-o", page, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("report"))
    assert document["results"] == [{"name": "r.mcap", "all": 5, "shown": 5, "detailed": 5, "pictures": 0}]
    first = page.read_bytes()
    assert document["bytes"] == len(first)
    assert call("report", log, "-o", page) == 0  # an earlier result of the same may be replaced
    assert page.read_bytes() == first
    page.write_text("mine")
    assert "--overwrite" in refused(capsys, 2, "report", log, "-o", page)


def test_the_policy_forbids_all_network(tmp_path: Path) -> None:
    assert call("report", localized_log(tmp_path / "r.mcap"), "-o", tmp_path / "r.html") == 0
    text = (tmp_path / "r.html").read_text()
    assert "default-src &#39;none&#39;; script-src &#39;sha256-" in text


@pytest.mark.parametrize(
    ("source", "said"),
    [(MAP_DB, " landmarks of 3 classes."), (APPENDIX_D, "20 positions were computed.")],
)
def test_a_map_and_the_thesis_have_a_page(source: Path, said: str, tmp_path: Path) -> None:
    assert call("report", source, "-o", tmp_path / "p.html") == 0
    text = (tmp_path / "p.html").read_text()
    assert said in text
    assert "has no bundles to look at" in text


def test_what_is_missing_is_said_with_what_to_run(tmp_path: Path) -> None:
    log = write(tmp_path / "r.mcap", [entry for entry in localized_messages() if entry[0] != TRUTH_POSE])
    assert call("report", log, "-o", tmp_path / "r.html") == 0
    text = (tmp_path / "r.html").read_text()
    assert "There is no truth in r.mcap" in text
    assert "--reference" in text
    assert "no landmarks are drawn" in text


def test_trouble_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, page = localized_log(tmp_path / "r.mcap"), tmp_path / "r.html"
    assert "ends with .html" in refused(capsys, 2, "report", log, "-o", tmp_path / "r.pdf")
    assert "none.mcap" in refused(capsys, 1, "report", tmp_path / "none.mcap", "-o", page)
    bare = write(tmp_path / "bare.mcap", [entry for entry in localized_messages() if entry[0] == TRUTH_POSE])
    assert "holds no results to show; run localize" in refused(capsys, 1, "report", bare, "-o", page)
    assert not page.exists()
    another = MAP_DB.with_name("localize.mcap")
    assert "are of two drives" in refused(capsys, 2, "report", log, another, "--diff", "-o", page)
    log.write_bytes(log.read_bytes()[:-200])
    assert call("report", log, "-o", page, "--lenient") == 3
    assert "warning: " in capsys.readouterr().err
    assert "Not all of the file could be read" in page.read_text()


def test_what_a_run_printed_tells_how_long_its_stages_took(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, page, printed = localized_log(tmp_path / "r.mcap"), tmp_path / "r.html", tmp_path / "run.json"
    printed.write_text(json.dumps({"logs": [{"output": f"out/{name}", "seconds": {"fuse": 1.25}} for name in "ab"]}))
    assert "is of a, b, and not of r.mcap" in refused(capsys, 2, "report", log, "-o", page, "--run", printed)
    printed.write_text(json.dumps({"output": "out/r.mcap", "seconds": {"fuse": 1.25, "localize": 2.0}}))
    assert call("report", log, "-o", page, "--run", printed) == 0
    assert "The stages that ran took 3.2 s." in page.read_text()
    assert "is of one result" in refused(capsys, 2, "report", log, log, "-o", page, "--run", printed)
    assert "cannot be read as JSON" in refused(capsys, 2, "report", log, "-o", page, "--run", log)


def test_two_runs_that_were_moved_onto_the_truth_have_the_figures_behind_that(tmp_path: Path) -> None:
    logs = [localized_log(tmp_path / name) for name in ("a.mcap", "b.mcap")]
    for align, words in (((), 0), (("--align",), 1)):
        assert call("report", *logs, "--diff", *align, "-o", tmp_path / f"{words}.html") == 0
        assert ("alignment.x_m" in (tmp_path / f"{words}.html").read_text()) is bool(words)


@pytest.mark.slow
def test_what_is_missing_among_many_is_named_and_what_is_named_twice_counts_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, page = localized_log(tmp_path / "r.mcap"), tmp_path / "fleet.html"
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.mcap").symlink_to(log)
    many = (log, tmp_path / "none.mcap", tmp_path / "none.db", tmp_path / "folder", log, tmp_path / "link.mcap")
    assert call("report", *many, "-o", page, "--json") == 3
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert [one["name"] for one in document["results"]] == ["r.mcap"]
    assert [loss.split(" could not")[0] for loss in document["losses"]] == ["none.mcap", "none.db", "folder"]
    assert f"note: {log} was named twice and counts once" in printed.err
    text = page.read_text()
    assert all(f"{name} could not be read" in text for name in ("none.mcap", "none.db", "folder"))
    assert call("report", *many, "-o", page) == 3  # of the same, so that it may be replaced
    assert call("report", log, log, "-o", tmp_path / "twice.html") == 0
    assert "1 results" not in (tmp_path / "twice.html").read_text()
    missing = (tmp_path / "none.mcap", tmp_path / "folder")
    assert "none of 2 results can be read" in refused(capsys, 1, "report", *missing, "-o", tmp_path / "no.html")


@pytest.mark.slow
def test_a_catalogue_stands_for_the_last_output_of_each_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    catalogue, page = tmp_path / "runs.parquet", tmp_path / "fleet.html"
    (tmp_path / "out").mkdir()
    localized_log(tmp_path / "out" / "a.mcap")
    outputs = {"a.mcap": "out/a.mcap", "b.mcap": "out/b.mcap", "c.mcap": None}
    append_rows(catalogue, [row("a.mcap", "old.mcap"), *(row(log, output, 1) for log, output in outputs.items())])
    assert call("report", catalogue, "-o", page) == 3
    printed = capsys.readouterr()
    assert "table of a.mcap" in printed.out
    assert f"b could not be read: {tmp_path}/out/b.mcap: is gone" in printed.err
    assert "c could not be read: c.mcap: its last run left no output: failed" in page.read_text()
    assert "is of many" in refused(capsys, 2, "report", catalogue, catalogue, "--diff", "-o", page)
    assert "leave it out" in refused(capsys, 2, "report", catalogue, "--run", page, "-o", tmp_path / "x.html")
