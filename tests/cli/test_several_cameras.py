"""Logs with several cameras, from images to a map: which are taken, what is said of it, a landmark for each thing."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, DETECTIONS, SCAN, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Channel, Stamped
from scipy.spatial.transform import Rotation

from tests.cli.calls import call, refused, schema_of, topics
from tests.cli.logs import write
from tests.runs.chain import COUNT, STEP_M, raw_messages, two_posts

CAMERAS = {"front": 0.0, "twin": 0.0, "left": 90.0}
"""Names of the cameras and where they look, in degrees: two of them see the same."""
STANDING = ((3.0, 0.0, 0.25), (2.8, 1.03, 0.15), (0.08, 3.0, 0.25), (-0.95, 2.8, 0.15))
"""Where things stand in the odometry frame, and their radii: a person and a fire hydrant, ahead and on the left."""
NAMES = ("person", "fire hydrant") * 2


def images(name: str) -> str:
    return f"/{name}/image_raw/compressed"


def scan(now: int, x_m: float) -> LaserScan:
    """What a LiDAR sees of what stands around."""
    bearings = np.arange(360) * np.deg2rad(1)
    ranges = np.full(360, np.inf)
    for x, y, radius_m in STANDING:
        along = (x - x_m) * np.cos(bearings) + y * np.sin(bearings)
        beside = (x - x_m) * np.sin(bearings) - y * np.cos(bearings)
        hit = (along > 0) & (np.abs(beside) < radius_m)
        ranges[hit] = np.minimum(ranges[hit], along[hit] - np.sqrt(radius_m**2 - beside[hit] ** 2))
    step, none = np.deg2rad(1), np.zeros(0, np.float32)
    return LaserScan(now, "base_scan", 0.0, 359 * step, step, 0.0, 0.1, 0.1, 10.0, ranges.astype(np.float32), none)


def mounted(name: str) -> Transform:
    turned = Rotation.from_euler("z", CAMERAS[name], degrees=True) * Rotation.from_quat([-0.5, 0.5, -0.5, 0.5])
    return Transform(1, "base_footprint", f"{name}_optical", np.array([0.0, 0.0, 0.2]), turned.as_quat())


def messages(*names: str) -> list[Stamped]:
    """The log of `tests.runs.chain` with other cameras, whose drivers give images other frames than CameraInfo."""
    found = []
    for stamped in raw_messages():
        message, at = stamped.message, stamped.log_time_ns
        for i, name in enumerate(names):
            if isinstance(message, CompressedImage):
                late = at + 10_000_000 * i
                image = dataclasses.replace(message, stamp_ns=late, frame_id=f"{name}_camera")
                found.append(Stamped(Channel(images(name), CompressedImage), late, image))
            if isinstance(message, CameraInfo):
                info = dataclasses.replace(message, frame_id=f"{name}_optical")
                found.append(Stamped(Channel(f"/{name}/camera_info", CameraInfo), at, info))
        if isinstance(message, TFMessage):
            found.append(Stamped(TF_STATIC, at, TFMessage((message.transforms[0], *map(mounted, names)))))
        elif isinstance(message, LaserScan):
            found.append(Stamped(SCAN, at, scan(at, STEP_M * (at // 200_000_000 - 1))))
        elif stamped.channel not in {CAMERA_IMAGE, CAMERA_INFO}:
            found.append(stamped)
    return sorted(found, key=lambda stamped: stamped.log_time_ns)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    write(tmp_path / "log.mcap", messages(*CAMERAS))
    two_posts(tmp_path / "model.onnx")
    return tmp_path


def last_scene(path: Path) -> tuple[tuple[str, ...], Array]:
    with open_recording(path) as recording:
        *_, raw = recording.messages(recording.connections(SCENE_OBJECTS.topic))
        scene = decode(SCENE_OBJECTS.message, raw.data)
    return scene.classes, scene.positions_xy


def test_from_images_to_a_map_verb_by_verb(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, seen, scanned, fused = (here / f"{name}.mcap" for name in ("log", "seen", "scanned", "fused"))
    assert call("detect", log, "-o", seen, "--model", here / "model.onnx", "--image", "all", "--json") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["images"] == 3 * COUNT
    assert (
        "images of 3 cameras: /front/image_raw/compressed (/front/camera_info, frame front_optical), /left" in said.err
    )
    with open_recording(seen) as recording:
        raws = list(recording.messages())
    boxes = [decode(DETECTIONS.message, raw.data) for raw in raws if raw.connection.topic == DETECTIONS.topic]
    assert [one.frame_id for one in boxes] == [f"{name}_optical" for name in CAMERAS] * COUNT
    for name in CAMERAS:
        stamps = [one.stamp_ns for one in boxes if one.frame_id == f"{name}_optical"]
        shown = [raw for raw in raws if raw.connection.topic == f"/{name}/annotations"]
        assert [decode(ImageAnnotations, raw.data).stamp_ns for raw in shown] == stamps
    assert call("cluster", seen, "-o", scanned) == 0
    capsys.readouterr()
    assert call("fuse", scanned, "-o", fused, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["classes"] == {"fire hydrant": 2 * COUNT, "person": 2 * COUNT}
    assert document["dropped"] == {}
    classes, places = last_scene(fused)
    assert sorted(classes) == sorted(NAMES)
    assert len(places) == len(STANDING)
    words = ("--map", here / "map.db", "--model", here / "model.onnx", "--json")
    assert call("map", fused, *words) == 0  # the choice of images stays
    found = json.loads(capsys.readouterr().out)
    assert found["landmarks"] + found["tentative"] == len(STANDING)
    assert found["stages"] == {"detect": "reused", "cluster": "reused", "fuse": "reused", "build_map": "ran"}


def test_in_one_go_topics_are_chosen_once(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each landmark where it stands, seen by its camera; the same in one run as verb by verb."""
    chosen = [word for name in ("front", "left") for word in ("--image", images(name))]
    words = (
        "map",
        here / "log.mcap",
        "--map",
        here / "map.db",
        "--model",
        here / "model.onnx",
        "-o",
        here / "out.mcap",
    )
    assert call(*words, *chosen) == 0
    classes, places = last_scene(here / "out.mcap")
    assert len(classes) == len(STANDING)
    for (x, y, _), name in zip(STANDING, NAMES, strict=True):
        off = np.hypot(*(places - [x - STEP_M * (COUNT - 1), y]).T)
        assert classes[int(off.argmin())] == name
        assert off.min() < 0.05
    capsys.readouterr()
    assert call(*words, *chosen) == 0
    assert "detect reused" in capsys.readouterr().err
    assert call(*words, "--image", images("front")) == 0
    assert "detect ran: the option images, topics changed" in capsys.readouterr().err
    assert len(last_scene(here / "out.mcap")[0]) == 2


def test_nothing_is_guessed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("detect", here / "log.mcap", "-o", here / "out.mcap", "--model", here / "model.onnx")
    line = refused(capsys, 2, *words)
    assert "could be the image; choose with --image TOPIC, several times or --image all for several cameras" in line
    line = refused(capsys, 2, *words, "--image", "all", "--image", images("front"))
    assert "--image all takes every camera that has a CameraInfo; give it alone, or name topics" in line
    line = refused(capsys, 2, *words, "--image", images("front"), "--image", images("rear"))
    assert "there are no images on /rear/image_raw/compressed for --image" in line


def test_a_single_camera_is_as_it_was(here: Path) -> None:
    """Of several or the only one: the same detections and annotations, in the frame that its images have."""
    only = write(here / "only.mcap", messages("front"))
    model = ("--model", here / "model.onnx", "--results-only")
    assert call("detect", here / "log.mcap", "-o", here / "one.mcap", *model, "--image", images("front")) == 0
    assert call("detect", only, "-o", here / "two.mcap", *model) == 0
    found = []
    for name in ("one", "two"):
        with open_recording(here / f"{name}.mcap") as recording:
            found.append([(raw.connection.topic, raw.log_time_ns, bytes(raw.data)) for raw in recording.messages()])
    assert found[0] == found[1]
    assert topics(here / "one.mcap").keys() == {DETECTIONS.topic, "/front/annotations"}


def test_cameras_whose_topics_do_not_lie_apart_are_told_by_their_frames(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And of what cannot be read the topic is told."""
    flat = []
    for stamped in messages("front", "left"):
        name = stamped.channel.topic.split("/")[1]
        message, topic = stamped.message, stamped.channel.topic
        if isinstance(message, CompressedImage):
            is_broken = name == "left" and stamped.log_time_ns > 300_000_000
            message = dataclasses.replace(message, frame_id=f"{name}_optical", data=b"" if is_broken else message.data)
            topic = f"/image_{name}"
        if isinstance(message, CameraInfo):
            topic = f"/info_{name}"
        flat.append(Stamped(Channel(topic, type(message)), stamped.log_time_ns, message))
    log, out = write(here / "flat.mcap", flat), here / "out.mcap"
    words = ("run", log, "--stages", "detect,cluster,fuse", "--model", here / "model.onnx", "-o", out)
    assert call(*words, "--image", "all") == 3
    assert f"warning: {out}: /image_left: {COUNT - 1} messages could not be decoded in all" in capsys.readouterr().err
    assert len(last_scene(out)[0]) == len(STANDING)
    assert topics(out)["/image_front/annotations"] == COUNT
    assert topics(out)["/image_left/annotations"] == 1
    words = ("detect", log, "-o", out, "--overwrite", "--model", here / "model.onnx", "--image", "/image_left")
    assert call(*words) == 3
    assert call("fuse", here / "out.mcap", "-o", here / "no.mcap") == 1  # there are no scan objects yet


def test_a_camera_without_a_place_on_the_robot_is_named(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = [
        dataclasses.replace(one, message=TFMessage(one.message.transforms[:-1])) if one.channel == TF_STATIC else one
        for one in messages(*CAMERAS)
    ]
    log = write(here / "lost.mcap", content)
    words = ("run", log, "--stages", "detect,cluster,fuse", "-o", here / "out.mcap", "--model", here / "model.onnx")
    capsys.readouterr()
    assert call(*words, "--image", "all") == 1
    assert "no transforms lead from left_optical to base_footprint" in capsys.readouterr().err


def test_explain_says_which_camera_saw_what(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("run", here / "log.mcap", "--stages", "detect,cluster,fuse", "-o", here / "out.mcap")
    assert call(*words, "--model", here / "model.onnx", "--image", "all") == 0
    with open_recording(here / "out.mcap") as recording:
        raw = next(iter(recording.messages(recording.connections(SCENE_OBJECTS.topic))))
    capsys.readouterr()
    assert call("explain", here / "out.mcap", "--at", raw.log_time_ns, "-o", here / "picture.png") == 0
    said = capsys.readouterr().out
    assert "person 0.90, fire hydrant 0.80, in the image of left_optical 20 ms after the scan" in said
    assert "person 0.90, fire hydrant 0.80, in the image of twin_optical 10 ms after the scan" in said
    assert (here / "picture.png").stat().st_size > 0
    assert call("explain", here / "out.mcap", "--at", raw.log_time_ns, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert {entry["camera"] for entry in document["detections"]} == {f"{name}_optical" for name in CAMERAS}
    assert schema_of("explain")["properties"]["detections"]["items"]["required"][-1] == "camera"
