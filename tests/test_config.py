"""Settings: files, single settings, and what an unknown one is answered."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.config import effective, gather, load
from mcap_landmarks.errors import UsageError
from mcap_landmarks.resources import resource
from mcap_landmarks.runs.config_text import everything, json_schema, toml


def test_a_setting_goes_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text("[localize]\nmax_sigma_m = 0.2\nrobust_dof = 3\n")
    config = load("localize", gather(file, ["localize.max_sigma_m=0.3"], None))
    assert (config.max_sigma_m, config.robust_dof) == (0.3, 3.0)
    assert effective(config)["max_sigma_m"] == 0.3


def test_method_counts_for_every_stage() -> None:
    settings = gather(None, ["localize.method=default"], "thesis")
    assert load("localize", settings).method == "default"
    assert load("build_map", settings).method == "thesis"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["localize.max_sigm_m=1"], "did you mean max_sigma_m"),
        (["localise.max_sigma_m=1"], "did you mean localize"),
        (["max_sigma_m=1"], "write STAGE.KEY=VALUE"),
        (["localize.max_sigma_m=wide"], "localize.max_sigma_m = 'wide'"),
        (["localize.max_sigma_m=true"], "localize.max_sigma_m = True: give a number"),
        (["localize.max_sigma_m=nan"], "localize.max_sigma_m = nan: give a number"),
        (["detect.threads='2'"], "detect.threads = '2': give a number"),
        (["cluster.range_m=[true, 3]"], "cluster.range_m.0 = True: give a number"),
        (["localize.method=magic"], "'default' or 'thesis'"),
        (["detect.class_confidence.person=2"], r"detect.class_confidence.person = 2: Input should be less than"),
        (["fuse.sizes.dog={top_m=[0, 1], width_m=[0, 1], radus_m=0.1, radius_m=0.1}"], "did you mean radius_m"),
        (["cluster.shapes.dog=[{kind='disc', radius_m=0.1, colour=1}]"], "colour is no setting of cluster.shapes.dog"),
        (["localize=3"], "write STAGE.KEY=VALUE"),
        (["cluster.range_m=[15, 0.5]"], "give the lower number first"),
        (["cluster.slice_m=[0.3, 0.3]"], "give the lower number first"),
        (["detect.tiles=0"], r"^detect.tiles = 0: Input should be greater than .* 1 or Input should be 'auto'$"),
        (["fuse.landmark_classes=person"], r'give a list, such as \["person", "suitcase"\]'),
    ],
)
def test_wrong_settings_name_the_remedy(settings: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        load("localize", gather(None, settings, None))


def test_settings_below_the_first_level(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text("[detect.class_confidence]\nperson = 0.4\ncar = 0.1\n")
    given = gather(file, ["detect.class_confidence.person=0.5", 'detect.class_confidence."stop sign"=0.2'], None)
    assert load("detect", given).class_confidence == {"person": 0.5, "car": 0.1, "stop sign": 0.2}
    assert load("detect", gather(None, ["detect.provider=cpu", "detect.classes=['a']"], None)).classes == ("a",)


def test_settings_of_stages_that_do_not_run_are_checked_too(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text("[fuse]\nbearing_gat = 4.0\n")
    with pytest.raises(UsageError, match="bearing_gat is no setting of fuse; did you mean bearing_gate"):
        gather(file, [], None)
    file.write_text('[detect]\nmodel = "any.onnx"\n')
    assert gather(file, [], None) == {"detect": {"model": "any.onnx"}}


@pytest.mark.parametrize(
    "settings", [[], ["detect.confidence=0.3", "localize.max_sigma_m=1e-5", 'detect.classes=["é"]']]
)
def test_what_is_shown_reads_back_as_it_is(tmp_path: Path, settings: list[str]) -> None:
    shown = everything(gather(None, settings, None))
    file = tmp_path / "config.toml"
    file.write_text(toml(shown))
    again = gather(file, [], None)
    assert everything(again) == shown


def test_toml_of_odd_values() -> None:
    odd = {
        "a b": {"x": [True, {"k k": float("inf")}], "text": 'quo"te\n', "low": 1e-7, "gone": None, "inner": {"y.z": 1}}
    }
    assert tomllib.loads(toml(odd)) == {"a b": {key: value for key, value in odd["a b"].items() if value is not None}}


def test_the_schema_in_the_repository_is_current() -> None:
    kept = json.loads(resource("schemas", "json/config.schema.json").read_text())
    assert kept == json_schema(), "run: mcap-landmarks config schema > schemas/json/config.schema.json"
    jsonschema.Draft202012Validator.check_schema(kept)


def test_the_schema_takes_what_the_program_takes() -> None:
    schema = jsonschema.Draft202012Validator(json_schema())
    shown = tomllib.loads(toml(everything({})))
    schema.validate(shown)
    schema.validate({"detect": {"model": "m.onnx"}, "fuse": {"extrinsics": "e.toml"}})
    for wrong in ({"detekt": {}}, {"detect": {"confidense": 1}}, {"detect": {"iou": 2}}, {"fuse": {"sizes": {"a": 1}}}):
        assert not schema.is_valid(wrong)


@pytest.mark.parametrize(("text", "words"), [("x = 1", "outside a stage's table"), ("[", "not a TOML file")])
def test_wrong_files_name_the_remedy(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "config.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=words):
        gather(file, [], None)
    with pytest.raises(UsageError, match="no such configuration file"):
        gather(tmp_path / "no.toml", [], None)
