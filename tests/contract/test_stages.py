"""The shape that every stage has."""

import dataclasses
import importlib
import inspect

import pytest
from mcap_landmarks import channels
from mcap_landmarks.config import effective, stage_config
from mcap_landmarks.diff.logs import Topic
from mcap_landmarks.diff.maps import FIELDS
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.stage import Channel, Connection, Reduction, Stage, Tolerance
from mcap_landmarks.stages import find_stage, stage_names

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
    else:
        assert isinstance(stage, Reduction)
        assert (stage.collect, stage.solve) == (module.collect, module.solve)


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
