"""The verb fuse: scenes beside what the log has, and what is said where something is missing."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap_landmarks import channels
from mcap_landmarks.cli.main import run
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.logs import write
from tests.fusion.cylinders import THREE, boxes, detected, information, mounted, moved, scanned

SCHEMA: Any = json.loads(resource("schemas", "json/fuse.schema.json").read_text())
SCAN_NS, IMAGE_NS, TURN_RADPS = 200_000_000, 100_000_000, 0.8
START_NS = 10**18
NAMES = [thing.name for thing in THREE]


def messages(count: int = 5) -> list[Stamped]:
    """A robot that turns on the spot: scans at 5 Hz, images at 10 Hz a little later, odometry at 50 Hz."""
    found = [
        Stamped(channels.TF_STATIC, START_NS, mounted()),
        Stamped(channels.CAMERA_INFO, START_NS, information()),
    ]
    velocity = (0.0, 0.0, TURN_RADPS)
    for i in range(-1, 10 * count):
        at = START_NS + 20_000_000 * i
        pose = (0.0, 0.0, TURN_RADPS * 0.02 * i)
        odometry = Odometry.planar(at, ("odom", "base_footprint"), pose, np.zeros((3, 3)))
        found.append(Stamped(channels.ODOMETRY, at, odometry))
    for i in range(count):
        at = START_NS + i * SCAN_NS
        found.append(Stamped(channels.SCAN_OBJECTS, at, scanned(moved(THREE, velocity, i * 0.2), at)))
    for i in range(2 * count):
        at = START_NS + i * IMAGE_NS + 40_000_000
        seen = boxes(moved(THREE, velocity, i * 0.1 + 0.04))
        found.append(Stamped(channels.DETECTIONS, at, detected(NAMES, seen, at)))
    return sorted(found, key=lambda stamped: stamped.log_time_ns)


def without(found: list[Stamped], *gone: Channel[Message]) -> list[Stamped]:
    return [stamped for stamped in found if stamped.channel not in gone]


def fuse(log: Path, output: Path, *options: str) -> int:
    with pytest.raises(SystemExit) as done:
        run(["fuse", str(log), "-o", str(output), *options])
    assert isinstance(done.value.code, int)
    return done.value.code


def scenes(path: Path) -> list[tuple[str, ...]]:
    with open_recording(path) as recording:
        raws = recording.messages(recording.connections(channels.SCENE_OBJECTS.topic))
        return [decode(channels.SCENE_OBJECTS.message, raw.data).classes for raw in raws]


def test_scenes_stand_beside_what_the_log_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", messages()), tmp_path / "out.mcap"
    assert fuse(log, out, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert (document["scans"], document["objects"]) == (5, 15)
    assert document["classes"] == dict.fromkeys(sorted(NAMES), 5)
    assert document["dropped"]["messages of /landmarks/detections that were nearest to no bundle"] == 5
    assert scenes(out) == [tuple(NAMES)] * 5
    with open_recording(out) as recording:
        counts = {entry.connection.topic: entry.count for entry in recording.channels}
    assert counts["/landmarks/scene_markers"] == 5
    assert counts["/landmarks/detections"] == 10


@pytest.mark.parametrize("source", ["tf", "pose"])
def test_odometry_may_be_transforms_or_poses(tmp_path: Path, capsys: pytest.CaptureFixture[str], source: str) -> None:
    found: list[Stamped] = []
    poses = Channel("/tracked", PoseStamped)
    for stamped in messages():
        step = stamped.message
        if not isinstance(step, Odometry):
            found.append(stamped)
        elif source == "tf":
            transform = Transform.planar(step.stamp_ns, (step.frame_id, step.child_frame_id), step.pose)
            found.append(Stamped(channels.TF, stamped.log_time_ns, TFMessage((transform,))))
        else:
            found.append(Stamped(poses, stamped.log_time_ns, PoseStamped.planar(step.stamp_ns, "odom", step.pose)))
    log, out = write(tmp_path / "log.mcap", found), tmp_path / "out.mcap"
    assert fuse(log, out, *(["--odom", "/tracked"] if source == "pose" else [])) == 0
    assert scenes(out) == [tuple(NAMES)] * 5
    assert "without odometry" not in capsys.readouterr().err


def test_transforms_from_before_the_start_count(tmp_path: Path) -> None:
    log, out = write(tmp_path / "log.mcap", messages()), tmp_path / "out.mcap"
    assert fuse(log, out, "--start", str(START_NS + SCAN_NS - 50_000_000)) == 0
    assert scenes(out) == [tuple(NAMES)] * 4


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        (channels.TF_STATIC, "--extrinsics FILE"),
        (channels.CAMERA_INFO, "there is no sensor_msgs/msg/CameraInfo"),
        (channels.DETECTIONS, "no /landmarks/detections"),
        (channels.SCAN_OBJECTS, "there is no /landmarks/scan_objects"),
    ],
    ids=lambda value: getattr(value, "topic", ""),
)
def test_what_is_missing_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], gone: Channel[Message], said: str
) -> None:
    log, out = write(tmp_path / "log.mcap", without(messages(), gone)), tmp_path / "out.mcap"
    assert fuse(log, out) == 1
    assert said in " ".join(capsys.readouterr().err.split())
    assert not out.exists()


def test_extrinsics_come_from_a_file(tmp_path: Path) -> None:
    log, out = write(tmp_path / "log.mcap", without(messages(), channels.TF_STATIC)), tmp_path / "out.mcap"
    mount = tmp_path / "mount.toml"
    mount.write_text(
        '[[transforms]]\nparent = "base_footprint"\nchild = "camera"\nxyz = [0.1, 0.0, 0.2]\n'
        "quaternion = [-0.5, 0.5, -0.5, 0.5]\n"
    )
    assert fuse(log, out, "--extrinsics", str(mount)) == 0
    assert scenes(out) == [tuple(NAMES)] * 5


def test_of_several_cameras_the_images_own_counts(tmp_path: Path) -> None:
    behind = dataclasses.replace(information(), intrinsics=np.diag([90.0, 90.0, 1.0]))
    image = Stamped(channels.CAMERA_IMAGE, START_NS, CompressedImage(START_NS, "camera", "jpeg", b""))
    found = [Stamped(Channel("/behind/camera_info", CameraInfo), START_NS, behind), *messages()]
    log, out = write(tmp_path / "log.mcap", [image, *found]), tmp_path / "out.mcap"
    assert fuse(log, out) == 0
    assert scenes(out) == [tuple(NAMES)] * 5
    assert fuse(write(tmp_path / "without.mcap", found), out) == 2


def test_sizes_and_classes_are_settings(tmp_path: Path) -> None:
    log, out = write(tmp_path / "log.mcap", messages()), tmp_path / "out.mcap"
    settings = tmp_path / "settings.toml"
    settings.write_text(
        '[fuse]\nlandmark_classes = ["person", "suitcase"]\n'
        "[fuse.sizes.person]\ntop_m = [0.2, 0.3]\nwidth_m = [0.2, 0.3]\nradius_m = 0.1\n"
    )
    assert fuse(log, out, "--config", str(settings)) == 0
    assert scenes(out) == [("suitcase",)] * 5
