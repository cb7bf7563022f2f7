"""The main job on logs of other sensors than ours, and what it says of logs that lack some, before hours are spent."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.channels import ODOMETRY, SCAN, TF
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.calls import call, refused
from tests.cli.logs import write
from tests.runs.chain import COUNT, counted, raw_messages, two_posts

CLOUD = Channel("/velodyne/points", PointCloud2)
POSES = Channel("/slam/pose", PoseStamped)
SLICED = ("--scan-from", CLOUD.topic, "--slice", "-0.1:0.1")


def changed(topic: Channel[Message], change: Callable[[Stamped], Stamped]) -> list[Stamped]:
    """The log of a robot that creeps towards a person and a hydrant, its messages of a topic changed."""
    return [change(stamped) if stamped.channel == topic else stamped for stamped in raw_messages()]


def as_cloud(stamped: Stamped) -> Stamped:
    scan: Any = stamped.message
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    points = np.stack([scan.ranges_m * np.cos(angles), scan.ranges_m * np.sin(angles), 0 * angles], axis=1)
    ground = np.array([[1.0, 0.0, -0.2], [0.0, 1.0, -0.2], [1.0, 1.0, 2.0]])
    points = np.concatenate([np.where(np.isfinite(points), points, np.nan), ground])
    return Stamped(CLOUD, stamped.log_time_ns, PointCloud2(scan.stamp_ns, scan.frame_id, points.astype(np.float32)))


def as_pose(stamped: Stamped) -> Stamped:
    step: Any = stamped.message
    return Stamped(POSES, stamped.log_time_ns, PoseStamped.planar(step.stamp_ns, "world", step.pose))


@pytest.fixture
def clouds(tmp_path: Path) -> tuple[Path, Path]:
    """A log with clouds in place of scans, and a detector."""
    return write(tmp_path / "log.mcap", changed(SCAN, as_cloud)), two_posts(tmp_path / "model.onnx")


@pytest.mark.slow
def test_a_slice_of_clouds_is_mapped_and_localized(
    clouds: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, model = clouds
    words = ("--map", tmp_path / "map.db", "--model", model, *SLICED)
    assert call("map", log, *words, "--json") == 0
    assert json.loads(capsys.readouterr().out)["landmarks"] == 2
    assert call("localize", log, *words, "-o", tmp_path / "out.mcap") == 0
    stages = ("--stages", "cluster", "-o", tmp_path / "run.mcap", "--json")
    capsys.readouterr()
    assert call("run", log, *SLICED, *stages) == 0
    assert json.loads(capsys.readouterr().out)["results"]["cluster"]["bundles"] == COUNT


def test_what_could_stand_in_is_named(
    clouds: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, model = clouds
    words = ("map", log, "--map", tmp_path / "map.db", "--model", model)
    line = refused(capsys, 1, *words)
    assert "no scan" in line
    assert "/velodyne/points could be it, choose with --scan-from TOPIC" in line
    line = refused(capsys, 2, *words, *SLICED, "--scan", SCAN.topic)
    assert "--scan-from takes the place of --scan" in line


def test_a_map_needs_odometry_which_is_said_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, model = counted(monkeypatch), two_posts(tmp_path / "model.onnx")
    log = write(tmp_path / "log.mcap", changed(ODOMETRY, as_pose))
    words = ("map", log, "--map", tmp_path / "map.db", "--model", model)
    line = refused(capsys, 1, *words)
    assert "no odometry" in line
    assert "/slam/pose could be it, choose with --odom TOPIC" in line
    assert not looks
    assert call(*words, "--odom", POSES.topic) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("frame", "is_written"), [("world", True), ("map", False), ("/map", False), ("", False)])
def test_no_frame_is_its_own_parent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], frame: str, is_written: bool
) -> None:
    def named(stamped: Stamped) -> Stamped:
        message: Any = as_pose(stamped).message
        return Stamped(POSES, stamped.log_time_ns, dataclasses.replace(message, frame_id=frame))

    log, model = write(tmp_path / "log.mcap", changed(ODOMETRY, named)), two_posts(tmp_path / "model.onnx")
    words = ("--map", tmp_path / "map.db", "--model", model, "--odom", POSES.topic)
    assert call("map", log, *words) == 0
    assert call("localize", log, *words, "-o", tmp_path / "out.mcap") == 0
    with open_recording(tmp_path / "out.mcap") as recording:
        counts = {entry.connection.topic: entry.count for entry in recording.channels}
    assert counts.get(TF.topic, 0) == (COUNT if is_written else 0)
    assert ("odometry names no frame of its own" in capsys.readouterr().err) != is_written


def test_clouds_of_which_none_can_be_read_say_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The stage after it would only say that there are no scan objects."""
    whole = write(tmp_path / "whole.mcap", changed(SCAN, as_cloud))
    log = tmp_path / "cut.mcap"
    with open_recording(whole) as recording, create_recording(log) as writer:
        for raw in recording.messages():
            data = raw.data[:-8] if raw.connection.topic == CLOUD.topic else raw.data
            writer.write(raw._replace(data=data))
    words = ("run", log, "-o", tmp_path / "out.mcap", *SLICED, "--stages", "cluster,fuse")
    line = refused(capsys, 1, *words)
    assert f"not one message of {CLOUD.topic} could be read: {CLOUD.topic} at " in line


def test_what_the_stages_found_is_told_where_nothing_can_be_mapped(
    clouds: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, model = clouds
    words = ("map", log, "--map", tmp_path / "map.db", "--model", model, "--scan-from", CLOUD.topic)
    line = refused(capsys, 1, *words, "--slice", "5:6")
    assert f"{log}: no bundle holds an object" in line
    assert f"(objects found: cluster 0, detect {2 * COUNT}, fuse 0)" in line
