"""The configuration from the command line."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.resources import resource

from tests.cli.calls import call, schema_of


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
    jsonschema.validate(document, schema_of(document["schema"].split("/")[1]))
    assert document["config"]["detect"]["iou"] == 0.6
    assert document["config"]["detect"]["model"] is None


def test_documents_are_named_as_their_schemas() -> None:
    for path in resource("schemas", "json").glob("*.schema.json"):
        named = json.loads(path.read_text()).get("properties", {}).get("schema", {}).get("const")
        assert named in {None, f"mcap-landmarks/{path.name.removesuffix('.schema.json')}/1"}, path


def test_an_unknown_key_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("config", "show", "--set", "detect.confidense=0.4") == 2
    assert "confidense is no setting of detect; did you mean confidence?" in capsys.readouterr().err


def test_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("config", "schema") == 0
    assert json.loads(capsys.readouterr().out)["$id"] == "mcap-landmarks/configuration/1"
