"""What cases.toml expects of the steps of a case: run in process, and every fact looked at."""

import json
import re
import tomllib
from functools import cache, reduce
from pathlib import Path
from typing import Any

import pytest
from mcap_landmarks.messages.typestore import RosObject
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import RawMessage
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.cli.calls import call
from tests.shared import data_folder

RECORDINGS = Path(__file__).parents[2] / "recordings"


def cases_folder() -> Path:
    """`cases` beside the data that others made."""
    data = data_folder()
    return (data.parent if data is not None else Path(__file__).resolve().parents[3] / "shared") / "cases"


@cache
def _cases() -> dict[str, dict[str, Any]]:
    found = tomllib.loads((cases_folder() / "cases.toml").read_text())
    return {case["name"]: case for case in found["case"]}


def check_case(
    name: str, folder: Path, site: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Run the steps of a case in the folder of its input; where it may be refused, the refusal is as good."""
    monkeypatch.chdir(folder)
    for step in _cases()[name]["step"]:
        words = [_place(word, site) for word in step["run"].split()]
        capsys.readouterr()
        code = call(*words)
        said = "".join(capsys.readouterr())
        allowed = step.get("exit", [0, 3] if words[0] == "info" else 0)
        if code not in (allowed if isinstance(allowed, list) else [allowed]):
            assert "refusal" in step, said
            assert re.search(step["refusal"], said), said
            assert code in (1, 2)
            continue
        _check_words(step, said)
        if "landmarks" in step:
            _check_map(step, words[words.index("--map") + 1], capsys)
        if {"localized", "rmse_m", "nees"} & {*step}:
            _check_figures(step, words[words.index("-o") + 1], capsys)
        if {"messages", "value", "metadata_has", "defined", "boxes"} & {*step}:
            _check_content(step, Path(words[words.index("-o") + 1]))


def _place(word: str, site: Path | str) -> str:
    return word.replace("{site}", str(site)).replace("{recordings}", str(RECORDINGS))


def _check_words(step: dict[str, Any], said: str) -> None:
    warned = "\n".join(re.findall(r"(?m)^(?:problem|warning|error).*", said))
    assert all(re.search(pattern, said) for pattern in step.get("says", ())), said
    assert all(re.search(pattern, warned) for pattern in step.get("warns", ())), said
    assert not any(re.search(pattern, said) for pattern in step.get("never", ())), said


def _check_map(step: dict[str, Any], database: str, capsys: pytest.CaptureFixture[str]) -> None:
    reference = _place(step.get("reference", "{recordings}/demo_map.mcap"), "")
    assert call("evaluate", database, "--json", "--reference", reference) == 0
    found = json.loads(capsys.readouterr().out)["map"]
    assert found["landmarks"] == step["landmarks"], found
    assert (found["missing"], found["spurious"]) == (step.get("missing", 0), step.get("spurious", 0))
    assert found["rmse_aligned_m"] <= step.get("map_rmse_m", 0.1)


def _check_figures(step: dict[str, Any], output: str, capsys: pytest.CaptureFixture[str]) -> None:
    reference = ("--reference", _place(step["reference"], "")) if "reference" in step else ()
    assert call("evaluate", output, "--json", *reference) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["localized"] >= step.get("localized", 0.0) * found["bundles"], found
    assert found["position"]["rmse_m"] <= step.get("rmse_m", 1.0), found
    assert found["nees"] <= step.get("nees", 10.0), found
    assert found["false"]["count"] == 0


def _check_content(step: dict[str, Any], output: Path) -> None:
    """What is in an output: counts, one value, metadata, definitions, detections."""
    with open_recording(output) as recording:
        entries = [entry.connection for entry in recording.channels if entry.count]
        undefined = [entry.topic for entry in entries if not (entry.message_type and entry.schema)]
        last = {raw.connection.topic: raw for raw in recording.messages()}
        count = sum(entry.count for entry in recording.channels)
        boxes = [
            raw for raw in recording.messages() if raw.connection.message_type == "vision_msgs/msg/Detection2DArray"
        ]
        metadata = str(recording.metadata)
    least, most = step["messages"] if isinstance(wanted := step.get("messages", count), list) else (wanted, wanted)
    assert least <= count <= most, count
    assert step.get("metadata_has", "") in metadata, metadata
    assert not (step.get("defined") and undefined), undefined
    if "value" in step:
        topic, field, value = step["value"]
        assert reduce(getattr, field.split("."), _decoded(last[topic])) == pytest.approx(value)
    if "boxes" in step:
        assert sum(len(_decoded(raw).detections) for raw in boxes) == step["boxes"]


def _decoded(raw: RawMessage) -> RosObject:
    """A message as its own definition in the file says."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(raw.connection.schema.decode(), raw.connection.message_type))
    return store.deserialize_cdr(raw.data, raw.connection.message_type)
