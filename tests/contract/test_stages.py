"""The shape that every stage has."""

import ast
import dataclasses
import importlib
import inspect
from pathlib import Path
from typing import get_type_hints

import mcap_landmarks
import pytest
from mcap_landmarks import channels
from mcap_landmarks.config import effective, stage_config
from mcap_landmarks.diff.logs import Topic
from mcap_landmarks.diff.maps import FIELDS
from mcap_landmarks.inspection.info import NEEDS
from mcap_landmarks.inspection.topic_roles import ROLES
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.stage import Channel, Connection, Reduction, Stage, Tolerance
from mcap_landmarks.stages import find_stage, stage_names

PACKAGE = Path(mcap_landmarks.__file__).parent
KNOWN = {value.topic for value in vars(channels).values() if isinstance(value, Channel)}


def test_there_are_stages() -> None:
    assert {"build_map", "localize"} <= set(stage_names())


@pytest.mark.parametrize("name", stage_names())
def test_a_stage_has_its_shape(name: str) -> None:
    stage = find_stage(name)
    module = importlib.import_module(f"mcap_landmarks.stages.{name}")
    assert stage.name == name
    assert inspect.getdoc(module)
    assert stage.reads
    assert stage.writes
    assert {channel.topic for channel in (*stage.reads, *stage.writes)} <= KNOWN
    assert not {channel.topic for channel in stage.reads} & {t for t in KNOWN if t.startswith("/ground_truth/")}
    if isinstance(stage, Stage):
        assert stage.process is module.process
        assert get_type_hints(stage.process)["config"] is stage.config
    else:
        assert isinstance(stage, Reduction)
        assert (stage.collect, stage.solve) == (module.collect, module.solve)
        assert get_type_hints(stage.collect)["config"] is get_type_hints(stage.solve)["config"] is stage.config


@pytest.mark.parametrize("name", stage_names())
def test_what_a_declaration_says_of_channels_and_files_is_of_its_own(name: str) -> None:
    stage = find_stage(name)
    assert set(stage.required) <= set(stage.reads)
    assert len(set(stage.files)) == len(stage.files)
    assert not set(stage.files) & {field.name for field in dataclasses.fields(stage.config)}
    if isinstance(stage, Stage):
        assert stage.places.keys() <= set(stage.writes)
        assert stage.choices.keys() <= set(stage.resources)
        assert all(choose(None, True).path for choose in stage.choices.values())  # the generator's logs need no option
        for place in stage.places.values():
            assert get_type_hints(place).get("config", stage.config) is stage.config
        assert not stage.thinned or ROLES[stage.reads[0]].name == "image"  # the options that thin out name images


def test_the_runner_knows_no_stage_by_name() -> None:
    of_one_verb = {"localize_at.py", "build_map.py"}
    files = [PACKAGE / "config.py", *(path for path in (PACKAGE / "runs").glob("*.py") if path.name not in of_one_verb)]
    named = {
        f"{path.name}: {node.value}"
        for path in files
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and node.value in stage_names()
    }
    assert not named


def test_what_info_says_that_verbs_need_is_what_their_stages_require() -> None:
    stages = {"map" if name == "build_map" else name: find_stage(name) for name in stage_names()}
    for verb in NEEDS.keys() & stages.keys():
        assert NEEDS[verb] == tuple(ROLES[channel].name for channel in stages[verb].required)


@pytest.mark.parametrize("name", stage_names())
def test_tolerances_are_of_fields_that_diff_compares(name: str) -> None:
    stage = find_stage(name)
    known = {field for fields in FIELDS.values() for field in fields} if isinstance(stage, Reduction) else set()
    for channel in stage.writes:
        ros_type = channel.message.ROS_TYPE
        connection = Connection(channel.topic, ros_type, definition(ros_type).encode())
        known.update(Topic.of((connection,), (), lambda _field: Tolerance()).field_names())
    assert set(stage.tolerance) <= known, f"{name} writes {sorted(known)}"


@pytest.mark.parametrize("name", stage_names())
def test_a_configuration_has_defaults_and_says_what_they_mean(name: str) -> None:
    config = find_stage(name).config
    assert dataclasses.is_dataclass(config)
    assert config.__dataclass_params__.frozen
    defaults = stage_config(config, name, {})
    assert stage_config(config, name, effective(defaults)) == defaults
    documented = inspect.getdoc(config) or ""
    for field in dataclasses.fields(config):
        assert field.name == "method" or f"`{field.name}`" in documented, f"{name}.{field.name} is not explained"
    assert "thesis" in str(dataclasses.fields(config)[0].type)
