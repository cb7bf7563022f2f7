"""The verb export."""

import json
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, USAGE
from mcap_landmarks.evaluation import tum

from tests.cli.calls import call, refused, schema_of
from tests.diff.recordings import localized_log


@pytest.mark.parametrize("form", ["tum", "kitti", "CSV", "json"])
def test_a_file_appears_and_the_topic_is_told(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "out"
    assert call("export", log, "--format", form, "-o", out) == DONE
    told = capsys.readouterr()
    assert told.out == f"{out}: 3 poses of /landmarks/pose_cov in frame map\n"
    assert "is taken; --topic chooses another: /landmarks/pose, /ground_truth/pose" in told.err
    assert out.read_text().count("\n") >= 3


def test_the_truth_is_a_trajectory_like_any_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "truth.tum"
    assert call("export", log, "--format", "tum", "--topic", "/ground_truth/pose", "-o", out) == DONE
    assert not capsys.readouterr().err
    assert len(tum.parse(out.read_text(), "truth")) == 5
    assert call("evaluate", log, "--reference", out) == DONE


def test_trouble_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "out"
    assert call("export", log, "--format", "euroc", "-o", out) == USAGE
    assert "--format euroc: choose tum, kitti, csv, json" in capsys.readouterr().err
    assert call("export", log, "--format", "tum", "--topic", "/scan", "-o", out) == USAGE
    assert call("export", tmp_path / "none.mcap", "--format", "tum", "-o", out) == UNUSABLE
    assert not out.exists()
    log.write_bytes(log.read_bytes()[:-200])
    assert call("export", log, "--format", "csv", "-o", out) == PARTIAL
    assert "warning: " in capsys.readouterr().err
    assert out.exists()


def test_json_tells_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert call("export", log, "--format", "tum", "-o", tmp_path / "out", "--json") == DONE
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("export"))
    assert (document["format"], document["topic"], document["poses"]) == ("tum", "/landmarks/pose_cov", 3)


@pytest.mark.parametrize(
    ("form", "option"), [("rerun", "--topic"), ("rerun", "--images"), ("coco", "--child"), ("tum", "--images")]
)
def test_options_of_other_formats_are_refused(
    form: str, option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = localized_log(tmp_path / "r.mcap")
    line = refused(capsys, USAGE, "export", log, "--format", form, "-o", tmp_path / "out", option, "x")
    assert f"{option} is not for --format {form}" in line
