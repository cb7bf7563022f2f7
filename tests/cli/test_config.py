"""The configuration from the command line."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.resources import resource

from tests.cli.calls import call


def test_what_is_in_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "config.toml"
    file.write_text("[detect]\nconfidence = 0.4\niou = 0.5\n")
    words = ("config", "show", "--config", file, "--set", "detect.iou=0.6", "--method", "thesis")
    assert call(*words) == 0
    shown = tomllib.loads(capsys.readouterr().out)
    assert (shown["detect"]["confidence"], shown["detect"]["iou"], shown["detect"]["max_detections"]) == (0.4, 0.6, 300)
    assert {shown[stage]["method"] for stage in ("detect", "cluster", "fuse", "build_map", "localize")} == {"thesis"}
    assert call(*words, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json.loads(resource("schemas", "json/config_show.schema.json").read_text()))
    assert document["config"]["detect"]["iou"] == 0.6
    assert document["config"]["detect"]["model"] is None


def test_an_unknown_key_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("config", "show", "--set", "detect.confidense=0.4") == 2
    assert "confidense is no setting of detect; did you mean confidence?" in capsys.readouterr().err


def test_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("config", "schema") == 0
    assert json.loads(capsys.readouterr().out)["$id"] == "mcap-landmarks/configuration/1"
