"""The verb info."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from mcap_landmarks.channels import MAP, ODOMETRY, POSE, SCENE_OBJECTS, TF_STATIC, TRUTH_POSE
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.calls import schema_of
from tests.cli.logs import write
from tests.runs.chain import raw_log, raw_messages
from tests.sources.bags import write_mrclam, write_plain_db3, write_ros1, write_ros2

SCHEMA: dict[str, Any] = json.loads(resource("schemas", "json/info.schema.json").read_text())
SECOND = 10**9


def run(*arguments: str | Path) -> int:
    return run_command(build("info"), ["info", *map(str, arguments)])


def document(capsys: pytest.CaptureFixture[str], *arguments: str | Path, code: int = DONE) -> dict[str, Any]:
    assert run(*arguments, "--json") == code
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, SCHEMA)
    return found


def write_log(path: Path) -> Path:
    """A localized log of 10 s."""
    none = np.zeros((0, 2))
    scene = SceneObjects(0, "base_footprint", (), (), none, np.zeros((0, 2, 2)), np.zeros(0))
    pose = PoseStamped.planar(0, "map", (0, 0, 0))
    with create_recording(path) as writer:
        writer.add(Stamped(MAP, 0, scene))
        for i in range(11):
            now = i * SECOND
            odometry = Odometry.planar(now, ("odom", "base_footprint"), (i, 0, 0), np.eye(3))
            for channel, message in ((ODOMETRY, odometry), (SCENE_OBJECTS, scene), (POSE, pose), (TRUTH_POSE, pose)):
                writer.add(Stamped(channel, now, message))
    return path


def test_channels_roles_and_verbs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    found = document(capsys, write_log(tmp_path / "log.mcap"))
    assert (found["profile"], found["start_ns"], found["end_ns"]) == ("ros2", 0, 10 * SECOND)
    channels = {channel.pop("topic"): channel for channel in found["channels"]}
    assert channels["/odom"] == {"type": "nav_msgs/msg/Odometry", "count": 11, "rate_hz": 1.1, "role": "odometry"}
    assert channels["/landmarks/map"]["role"] is None
    assert channels["/landmarks/map"]["rate_hz"] is None
    assert channels["/landmarks/pose"]["role"] == "results"
    assert found["roles"] == {
        "image": [],
        "camera_info": [],
        "scan": [],
        "point_cloud": [],
        "odometry": ["/odom"],
        "scene_objects": ["/landmarks/scene_objects"],
        "truth": ["/ground_truth/pose"],
    }
    assert found["verbs"] == ["map", "localize", "evaluate"]
    assert found["missing"] == {"detect": ["image"], "cluster": ["scan"]}


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, write_ros1(tmp_path / "a.bag"))
    assert (found["profile"], found["roles"]["scan"]) == ("ros1", ["/scan"])
    assert found["missing"] == {
        "detect": ["image"],
        "map": ["scene_objects", "odometry"],
        "localize": ["scene_objects"],
        "evaluate": ["results", "truth"],
    }


def test_every_format_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in (
        write_ros2(tmp_path / "db3"),
        write_ros2(tmp_path / "mcap", storage="mcap"),
        write_plain_db3(tmp_path / "a.db3"),
    ):
        found = document(capsys, path)
        assert found["profile"] == "ros2"
        assert {channel["count"] for channel in found["channels"]} == {20}
    found = document(capsys, write_mrclam(tmp_path / "set"))
    assert [log["name"] for log in found["logs"]] == ["robot1", "robot2"]
    assert found["logs"][0]["verbs"] == ["map", "localize"]


def test_channels_that_cannot_be_converted_are_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        writer.add_message(writer.register_channel("/words", "json", 0), 5, b"{}", 5)
        writer.finish()
    found = document(capsys, path)
    assert [(channel["topic"], channel["count"]) for channel in found["channels"]] == [("/words", 1)]


def test_the_text_tells_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(write_log(tmp_path / "log.mcap"), write_mrclam(tmp_path / "set")) == DONE
    out = capsys.readouterr().out
    assert (
        "profile ros2, 1970-01-01T00:00:00.000000000Z to 1970-01-01T00:00:10.000000000Z, 10.000 s, 45 messages" in out
    )
    assert "ready for: map, localize, evaluate\n" in out
    assert f"\n\n{tmp_path}/set: robot2\n" in out
    assert "evaluate lacks: results\n" in out


def test_damage_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path / "log.mcap")
    path.write_bytes(path.read_bytes()[:-200])
    found = document(capsys, path, code=PARTIAL)
    assert found["losses"]
    assert run(path) == PARTIAL
    assert "warning: log.mcap: " in capsys.readouterr().err


def test_a_log_without_messages_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(write_plain_db3(tmp_path / "a.db3", count=0)) == DONE
    assert "profile ros2, no messages" in capsys.readouterr().out


def test_what_is_no_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path / "none", "--json") == UNUSABLE
    out, err = capsys.readouterr()
    jsonschema.validate(json.loads(out), schema_of("error"))
    assert err == f"error: {tmp_path}/none: there is no such file or folder; check the path\n"


def test_scene_objects_can_be_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, raw_log(tmp_path / "log.mcap"))
    assert found["verbs"] == ["detect", "cluster", "map", "localize"]


def test_the_network_for_the_images_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    log, demo = raw_log(tmp_path / "log.mcap"), resource("recordings", "demo_localize.mcap")
    found = document(capsys, log, "--check", code=PARTIAL)
    (finding,) = found["findings"]
    assert (found["verbs"], found["blocked"]["map"]) == (["cluster"], ["network"])
    assert (finding["level"], finding["check"], found["network"]) == ("problem", "network", None)
    assert "the bundled network knows rendered objects only" in finding["text"]
    assert finding["remedy"].startswith("get a real network once with `mcap-landmarks models get nanodet`, or give one")
    assert document(capsys, demo, "--check")["network"] == "bundled"
    request.getfixturevalue("cached_network")
    found = document(capsys, log, "--check")
    assert (found["findings"], found["network"]) == ([], "nanodet")
    assert run(log, "--check") == DONE
    assert "network for its images: nanodet" in capsys.readouterr().out
    assert document(capsys, demo, "--check")["network"] == "bundled"
    assert document(capsys, write_log(tmp_path / "blind.mcap"), "--check")["network"] is None


@pytest.mark.usefixtures("cached_network")
def test_a_good_log_has_no_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = raw_log(tmp_path / "log.mcap")
    assert document(capsys, log, "--check")["findings"] == []
    assert run(log, "--check") == DONE
    assert "nothing was found that costs results" in capsys.readouterr().out


@pytest.mark.usefixtures("cached_network")
def test_findings_are_told_with_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = [stamped for stamped in raw_messages() if stamped.channel not in {TF_STATIC, ODOMETRY}]
    log = write(tmp_path / "log.mcap", content)
    found = document(capsys, log, "--check", code=PARTIAL)
    findings = found["findings"]
    assert (found["verbs"], found["blocked"]["localize"]) == (["detect"], ["/scan", "/camera/camera_info"])
    assert [(finding["level"], finding["check"]) for finding in findings] == [
        ("problem", "frames"),
        ("problem", "frames"),
        ("warning", "frames"),
        ("warning", "scan"),
    ]
    assert run(log, "--check") == PARTIAL
    said = capsys.readouterr().out
    assert "localize fails, as said below of /scan, /camera/camera_info" in said
    assert "problem: /scan: there are no transforms: nothing says where the LiDAR (base_scan) sits" in said
    assert "problem: /camera/camera_info: no transforms lead from camera to base_scan; record /tf_static" in said
    assert "warning: there is no odometry" in said


def test_a_cloud_that_could_be_the_scan_is_named_with_the_option_that_takes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = PointCloud2(SECOND, "laser", np.ones((3, 3), dtype=np.float32))
    assert run(write(tmp_path / "cloud.mcap", [Stamped(Channel("/points", PointCloud2), SECOND, cloud)])) == DONE
    assert "cluster lacks: scan (/points could be it, choose with --scan-from TOPIC)\n" in capsys.readouterr().out
