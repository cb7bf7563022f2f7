"""Topics that no stage reads as they are: named with the reason and what to do, and never chosen by their type."""

from pathlib import Path

import pytest
from mcap_landmarks.inspection.format_checks import check_formats, check_videos
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.progress import unwatched
from mcap_landmarks.stage import ChannelSummary, Connection

from tests.sources.foxglove import STAMP, in_json, of_json, write

SCAN = "sensor_msgs/msg/LaserScan"
FORMATS = [
    (Connection("/scan", "foxglove.LaserScan", b"{}", "jsonschema", "json"), "json", "convert"),
    (Connection("/scan", "foxglove.LaserScan", b"x", "protobuf", "protobuf"), "protobuf", "convert"),
    (Connection("/scan", "foxglove_msgs/msg/LaserScan", b"float64[] ranges"), f"in place of {SCAN}", "convert"),
    (Connection("/scan", SCAN, b"{}", "jsonschema", "json"), "json", "record the log"),
    (Connection("/scan", "sensor_msgs/LaserScan", b"x", "ros1msg", "ros1"), "ROS 1", "convert"),
]


@pytest.mark.parametrize(("connection", "text", "remedy"), FORMATS)
def test_why_and_what_to_do(connection: Connection, text: str, remedy: str) -> None:
    (found,) = check_formats([ChannelSummary(connection, 1)])
    assert (found.level, found.topic) == ("problem", "/scan")
    assert text in found.text
    assert remedy in found.remedy


def test_what_is_read_is_no_finding() -> None:
    sound = Connection("/scan", SCAN, b"float32[] ranges")
    boxes = Connection("/annotations", "foxglove_msgs/msg/ImageAnnotations", b"x")
    assert list(check_formats([ChannelSummary(sound, 1), ChannelSummary(boxes, 1)])) == []


def test_messages_that_are_not_cdr_play_no_role(tmp_path: Path) -> None:
    """However their type is called; what can be converted is said where a scan is missing."""
    named = ("/named", SCAN, b"{}", "jsonschema", "json", [in_json({"ranges": [1.0]})])
    path = write(tmp_path / "log.mcap", named, of_json("/scan", "LaserScan", {"timestamp": STAMP, "ranges": [1.0]}))
    (info,) = describe(path, {}, unwatched)
    assert info.roles["scan"] == []
    assert "/scan is foxglove.LaserScan, which convert makes a message of ROS 2" in info.hints["scan"]
    assert {finding.topic for finding in info.problems} == {"/named", "/scan"}


def test_videos_need_pyav(monkeypatch: pytest.MonkeyPatch) -> None:
    video = [ChannelSummary(Connection("/video", "foxglove_msgs/msg/CompressedVideo", b"x"), 1)]
    assert list(check_videos(["/video"], video)) == []
    monkeypatch.setattr("mcap_landmarks.inspection.format_checks.find_spec", lambda _name: None)
    (found,) = check_videos(["/video"], video)
    assert (found.level, found.remedy) == ("problem", "pip install 'mcap-landmarks[video]'")
    assert list(check_videos(["/image"], video)) == []
