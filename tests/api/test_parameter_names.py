"""Errors in Python name parameters, and no options of a command line that nobody typed."""

import inspect
import shutil
from collections.abc import Callable
from pathlib import Path

import mcap_landmarks
import pytest
from mcap_landmarks.api import parameter_names
from mcap_landmarks.api.parameter_names import reworded
from mcap_landmarks.resources import resource


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (
            "a.mcap: /a and /b have poses; choose with --topic",
            "a.mcap: /a and /b have poses; choose with the parameter topic",
        ),
        ("give --slice ZMIN:ZMAX in m", "give heights=(ZMIN, ZMAX) in m"),
        (
            "needs a map; give --map FILE or --set localize.map=FILE",
            'needs a map; give map_file=FILE or settings={"localize.map": FILE}',
        ),
        ("the topic as it with --remap TOPIC=/camera_info", 'the topic as it with remap={"TOPIC": /camera_info}'),
        ("--set sigma_m=0.1: write STAGE.KEY", 'settings={"sigma_m": 0.1}: write STAGE.KEY'),
        ("replace it with --overwrite", "replace it with overwrite=True"),
        ("give one with --model FILE.onnx, such as", "give one with model=FILE.onnx, such as"),
        ("allow it with --max-memory", "allow it with --max-memory"),
    ],
)
def test_options_become_parameters(told: str, expected: str) -> None:
    assert reworded(told) == expected


def test_every_parameter_that_is_named_is_one() -> None:
    functions = [getattr(mcap_landmarks, name) for name in mcap_landmarks.__all__]
    functions += [mcap_landmarks.LogReader.poses]
    known = set(mcap_landmarks.Options.__annotations__)
    for one in functions:
        known |= set(inspect.signature(one).parameters) if callable(one) and not inspect.isclass(one) else set()
    named = [*parameter_names._TRUTHS, *parameter_names._VALUES]
    named = [name.replace("-", "_") for name in named]
    named += [*parameter_names._PAIRS.values(), *parameter_names._OTHER_NAMES.values()]
    assert {name for name in named if name not in known} == set()


def _refused(call: Callable[[], object]) -> str:
    with pytest.raises(mcap_landmarks.ToolkitError) as error:
        call()
    return str(error.value)


def test_readers_name_the_parameter_that_they_have() -> None:
    with mcap_landmarks.open_log(resource("recordings", "demo_localize.mcap")) as log:
        assert "the parameter topic needs" in _refused(lambda: log.odometry("/scan"))


def test_errors_of_the_functions_are_told_so(tmp_path: Path) -> None:
    log = shutil.copy(resource("recordings", "demo_localize.mcap"), tmp_path / "log.mcap")
    out = tmp_path / "out.mcap"
    out.write_bytes(b"mine")
    told = [
        _refused(lambda: mcap_landmarks.run(log, "localize", tmp_path / "o.mcap")),
        _refused(lambda: mcap_landmarks.run(log, "cluster", out)),
        _refused(lambda: mcap_landmarks.evaluate(log, align=True)),
        _refused(lambda: mcap_landmarks.open_log(log).poses("/scan")),
    ]
    assert "map_file=FILE" in told[0]
    assert "overwrite=True" in told[1]
    assert not [text for text in told if "--" in text]
