"""The verb foxglove: a layout as Foxglove exports it, which names nothing that the log does not have."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, SCAN
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.recording.reader import open_recording
from rosbags.interfaces import Nodetype

from tests.cli.calls import call, refused, schema_of
from tests.diff.recordings import localized_log, localized_messages, write
from tests.runs.chain import raw_log, raw_messages

DRAWN = {
    "visualization_msgs/msg/MarkerArray", "nav_msgs/msg/Path", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2",
}  # fmt: skip
"""What the 3D panels of both programs draw, of what a result has."""
PATH = re.compile(r"(/[\w/]+)((?:\.\w+|\[\d+\])+)(\.@sqrt)?")


def made(result: Path, folder: Path) -> dict[str, Any]:
    """The layout of a log."""
    assert call("foxglove", result, "-o", folder / "layout.json") == DONE
    found: dict[str, Any] = json.loads((folder / "layout.json").read_text())
    return found


def leaves(node: str | Mapping[str, Any]) -> Iterator[str]:
    """The panels of a mosaic, each split of two parts."""
    if isinstance(node, str):
        yield node
        return
    assert node.keys() == {"first", "second", "direction", "splitPercentage"}
    assert node["direction"] in {"row", "column"}
    assert 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def types(path: Path) -> dict[str, tuple[str, str]]:
    """Type and schema of each topic that has a message."""
    with open_recording(path) as recording:
        found = [entry.connection for entry in recording.channels if entry.count]
        return {one.topic: (one.message_type, one.schema.decode()) for one in found}


def is_number(ros_type: str, schema: str, steps: str) -> bool:
    """Whether a message path's steps lead to a number of a type, by its schema."""
    definition = layout_of(ros_type, schema).definition
    node: Any = (Nodetype.NAME, ros_type)
    for name, index in re.findall(r"\.(\w+)|\[(\d+)\]", steps):
        sort, detail = node
        if name:
            assert sort == Nodetype.NAME, f"{steps} goes into what is no message"
            node = dict(definition[detail])[name]
        else:
            assert sort in {Nodetype.ARRAY, Nodetype.SEQUENCE}, f"{steps} counts in what is no array"
            assert sort == Nodetype.SEQUENCE or int(index) < detail[1]
            node = detail[0]
    return bool(node[0] == Nodetype.BASE and node[1][0] != "string")


def test_a_layout_has_the_structure_of_an_export(whole_result: Path, tmp_path: Path) -> None:
    layout = made(whole_result, tmp_path)
    assert layout.keys() == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert layout["globalVariables"] == layout["userNodes"] == {}
    assert layout["playbackConfig"] == {"speed": 1}
    panels = [*leaves(layout["layout"])]
    assert sorted(panels) == sorted(layout["configById"])
    kinds = [re.fullmatch(r"(\w+)!\w+", panel)[1] for panel in panels]  # type: ignore[index] # fails where it is None
    assert sorted(kinds) == ["3D", "Image", "Plot", "Plot", "Plot", "StateTransitions"]


def test_every_topic_and_path_is_in_the_log(whole_result: Path, tmp_path: Path) -> None:
    panels, there = made(whole_result, tmp_path)["configById"], types(whole_result)
    scene = panels["3D!map"]
    assert {there[topic][0] for topic in scene["topics"]} <= DRAWN
    assert SCAN.topic in scene["topics"]  # map -> odom is written, so the scan is where the robot is
    assert all(settings["visible"] for settings in scene["topics"].values())
    assert scene["followTf"] == "map"
    mode = panels["Image!camera1"]["imageMode"]
    assert (mode["imageTopic"], mode["calibrationTopic"]) == (CAMERA_IMAGE.topic, CAMERA_INFO.topic)
    assert {there[topic][0] for topic in mode["annotations"]} == {"foxglove_msgs/msg/ImageAnnotations"}
    paths = [path for panel in panels.values() for path in panel.get("paths", ())]
    assert len(paths) == 8
    for path in paths:
        found = PATH.fullmatch(path["value"])
        assert found, path
        assert is_number(*there[found[1]], found[2]), path
    assert all(path["enabled"] for panel in panels.values() if "xAxisVal" in panel for path in panel["paths"])


def test_what_is_not_there_is_not_named(tmp_path: Path) -> None:
    layout = made(localized_log(tmp_path / "r.mcap"), tmp_path)
    assert [*layout["configById"]] == [
        "3D!map", "StateTransitions!status", "Plot!position", "Plot!sigma", "Plot!status"
    ]  # fmt: skip
    assert [*layout["configById"]["3D!map"]["topics"]] == [
        "/ground_truth/pose",
        "/landmarks/pose",
        "/landmarks/pose_cov",
    ]


def test_what_has_no_place_in_the_map_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scans = ((one.channel, one.log_time_ns, one.message) for one in raw_messages(2) if one.channel == SCAN)
    log = write(tmp_path / "log.mcap", [*scans, *localized_messages()])
    assert call("foxglove", log, "-o", tmp_path / "layout.json", "--json") == DONE
    told = capsys.readouterr()
    document = json.loads(told.out)
    jsonschema.validate(document, schema_of("foxglove"))
    assert document["left_out"] == [{"topic": "/scan", "reason": "no transforms lead from base_scan to map"}]
    assert "note: " in told.err


def test_before_any_run_the_robot_is_what_is_seen(tmp_path: Path) -> None:
    """The scan is shown where the LiDAR is on the robot, as nothing tells where that is."""
    panels = made(raw_log(tmp_path / "log.mcap"), tmp_path)["configById"]
    assert panels["3D!map"]["followTf"] == "base_footprint"
    assert [*panels["3D!map"]["topics"]] == ["/scan"]


def test_trouble_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "layout.json"
    assert refused(capsys, 2, "foxglove", log, "-o", log).endswith("is the input itself; write to another file")
    assert call("foxglove", tmp_path / "none.mcap", "-o", out) == UNUSABLE
    assert not out.exists()
    first = made(log, tmp_path)
    assert call("foxglove", log, "-o", out) == DONE  # nothing is lost where it is the same
    out.write_text("mine")
    assert "exists" in refused(capsys, 2, "foxglove", log, "-o", out)
    assert call("foxglove", log, "-o", out, "--overwrite") == DONE
    assert json.loads(out.read_text()) == first
    log.write_bytes(log.read_bytes()[:-200])
    assert call("foxglove", log, "-o", out, "--overwrite") == PARTIAL
